# Copyright 2026 flea_diag maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""Temporal causal graph: which variable affects which, with what sign, at once or over time.

Vertices are the efforts and flows of the bonds, the states and the channels. An edge carries
the partial derivative of the relation it comes from; edges into the rate of a state are
temporal (Mosterman and Biswas 1999; Narasimhan et al. 2010, section 3.1).
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import cached_property

from flea_diag.core.bond_graph.causal_relation import Relation, in_order
from flea_diag.core.symbolic.expression import (
    Constant,
    Expression,
    Variable,
    derivative,
    evaluate,
    substitute,
)
from flea_diag.core.symbolic.expression import symbols as symbols_of


@dataclass(frozen=True)
class Edge:
    """``source`` affects ``target`` with the sign of ``gain``; temporal: through integration."""

    source: str
    target: str
    gain: Expression
    temporal: bool
    element: str

    def label(self, tokens: Mapping[str, str] | None = None) -> str:
        """``=``, ``-1``, ``R``, ``dt/L``: the gain, times dt when temporal."""
        short = {name: Variable(token) for name, token in (tokens or {}).items()}
        gain = substitute(self.gain, short)
        if self.temporal:
            return str(Variable("dt") * gain)
        return "=" if gain == Constant(1.0) else str(gain)

    def sign(self, values: Mapping[str, float]) -> int:
        """Sign of the gain where the variables have these values."""
        number = float(evaluate(self.gain, values))
        return (number > 0) - (number < 0)


@dataclass(frozen=True)
class TemporalCausalGraph:
    """Edges between variables, and from parameters to the variables that they set directly."""

    vertices: tuple[str, ...]
    """In an order in which no instantaneous edge points backward."""
    edges: tuple[Edge, ...]
    parameter_edges: tuple[Edge, ...]
    inputs: tuple[str, ...]

    @cached_property
    def into(self) -> dict[str, tuple[Edge, ...]]:
        """Edges by their target."""
        return {v: tuple(e for e in self.edges if e.target == v) for v in self.vertices}

    @cached_property
    def parameters_into(self) -> dict[str, tuple[Edge, ...]]:
        """Parameter edges by their target."""
        return {v: tuple(e for e in self.parameter_edges if e.target == v) for v in self.vertices}

    @cached_property
    def of_parameter(self) -> dict[str, tuple[Edge, ...]]:
        """Parameter edges by their parameter."""
        names = dict.fromkeys(e.source for e in self.parameter_edges)
        return {n: tuple(e for e in self.parameter_edges if e.source == n) for n in names}

    def lines(self, tokens: Mapping[str, str] | None = None) -> tuple[str, ...]:
        """One edge a line: ``e_winding -> i  [dt/L]``."""
        rows = (*self.edges, *self.parameter_edges)
        return tuple(
            f"{e.source} -> {e.target}  [{e.label(tokens)}]{'  temporal' * e.temporal}"
            for e in rows
        )


def temporal_causal_graph(
    relations: Iterable[Relation], parameters: Iterable[str]
) -> TemporalCausalGraph:
    """TCG of causal relations: one edge for each variable, and each parameter, in each relation."""
    relations = tuple(relations)
    known = frozenset(parameters)
    edges: list[Edge] = []
    parameter_edges: list[Edge] = []
    for r in relations:
        for name in symbols_of(r.expression):
            edge = Edge(name, r.target, derivative(r.expression, name), r.temporal, r.element)
            (parameter_edges if name in known else edges).append(edge)
    targets = {r.target for r in relations}
    inputs = tuple(dict.fromkeys(e.source for e in edges if e.source not in targets))
    states = tuple(r.target for r in relations if r.temporal)
    instant = tuple(r.target for r in in_order(relations))
    return TemporalCausalGraph(
        (*inputs, *states, *instant), tuple(edges), tuple(parameter_edges), inputs
    )
