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

"""Condensed temporal causal graph: equal variables merged into one node, with the residuals.

Most edges of a TCG state that two variables are equal (for example the flows of a 1-junction).
Merging such variables shows the propagation paths of a fault at a glance.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property

from flea_diag.core.bond_graph.actuator_model import Actuator
from flea_diag.core.causal_graph.temporal_causal_graph import (
    TemporalCausalGraph,
    temporal_causal_graph,
)
from flea_diag.core.drawing.layered_layout import Layout, layered
from flea_diag.core.residuals.parity import parity_relation
from flea_diag.core.symbolic.expression import Constant

LONGEST_LABEL = 12
"""Longest gain drawn as text; a longer one is the slope of a law and is drawn as f."""


@dataclass(frozen=True)
class MapEdge:
    """``source`` affects ``target``; ``label`` is the gain."""

    source: str
    target: str
    label: str
    temporal: bool


@dataclass(frozen=True)
class CausalMap:
    """Nodes, edges, and the causes and residuals attached to each node.

    ``parameters`` are listed by the node they set directly; ``residuals`` name the channels that
    each parity relation reads. The residual of a measurement is the node of its channel; a
    residual normalised by direction is drawn where the plain one is (``plain``).
    """

    channels: tuple[str, ...]
    edges: tuple[MapEdge, ...]
    parameters: Mapping[str, tuple[str, ...]]
    residuals: Mapping[str, tuple[str, ...]]
    plain: Mapping[str, str]

    @cached_property
    def layout(self) -> Layout:
        """Positions of nodes and residuals; residuals are in the last layer."""
        reads = [(c, r) for r, channels in self.residuals.items() for c in channels]
        return layered([*((e.source, e.target) for e in self.edges), *reads], self.residuals)

    def path(self, cause: str, residual: str) -> tuple[str, ...]:
        """Nodes on the shortest path from a cause to a residual; empty if there is none.

        Parameters
        ----------
        cause
            A parameter, or a sensor fault (``motor_current_bias``).
        residual
            Name of a residual; one that is not in the map has no path.
        """
        residual = self.plain.get(residual, residual)
        wanted = set(self.residuals.get(residual, (residual,)))
        came: dict[str, str] = dict.fromkeys(self._start(cause), "")
        queue = deque(came)
        while queue:
            node = queue.popleft()
            if node in wanted:
                path = _back(came, node)
                return path if node == residual else (*path, residual)
            for edge in self.edges:
                if edge.source == node and edge.target not in came:
                    came[edge.target] = node
                    queue.append(edge.target)
        return ()

    def _start(self, cause: str) -> tuple[str, ...]:
        if cause in self.channels:
            return (cause,)
        set_by = tuple(node for node, names in self.parameters.items() if cause in names)
        return set_by or tuple(c for c in self.channels if cause.startswith(f"{c}_"))


def _back(came: Mapping[str, str], node: str) -> tuple[str, ...]:
    nodes = [node]
    while came[nodes[-1]]:
        nodes.append(came[nodes[-1]])
    return tuple(reversed(nodes))


def causal_map(actuator: Actuator) -> CausalMap:
    """Condensed TCG of an actuator with all residuals of its description."""
    graph = temporal_causal_graph(actuator.relations("stand"), actuator.graph.parameters)
    channels = tuple(actuator.sensors)
    same = _same(graph, frozenset(channels))
    tokens = actuator.graph.tokens()
    edges = {
        (same[e.source], same[e.target]): MapEdge(
            same[e.source], same[e.target], _short(e.label(tokens)), e.temporal
        )
        for e in graph.edges
        if same[e.source] != same[e.target]
    }
    parameters: dict[str, tuple[str, ...]] = {}
    for edge in graph.parameter_edges:
        node = same[edge.target]
        parameters[node] = tuple(dict.fromkeys((*parameters.get(node, ()), edge.source)))
    drawn = {name for pair in edges for name in pair}
    reads = {
        name: tuple(c for c in parity_relation(actuator, spec).channels if c in drawn)
        for name, spec in actuator.residuals.items()
        if not spec.predicts
    }
    plain = {
        name: other
        for name, spec in actuator.residuals.items()
        for other in reads
        if spec.normalised
        and actuator.residuals[other] == replace(spec, name=other, normalised=False)
    }
    residuals = {name: r for name, r in reads.items() if r and name not in plain}
    return CausalMap(channels, tuple(edges.values()), parameters, residuals, plain)


def _same(graph: TemporalCausalGraph, channels: frozenset[str]) -> dict[str, str]:
    """The node that represents each variable: follow 'equal' edges, except to channels."""

    def root(name: str) -> str:
        into = graph.into[name]
        equal = len(into) == 1 and not into[0].temporal and into[0].gain == Constant(1.0)
        return root(into[0].source) if equal and name not in channels else name

    return {name: root(name) for name in graph.vertices}


def _short(label: str) -> str:
    return label if len(label) <= LONGEST_LABEL else "f"
