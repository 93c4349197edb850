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

"""State equations x' = f(x, u; p), y = h(x, u; p), derived from the causal relations.

Derived by substitution, printed as text, differentiated exactly, and compiled to functions
over (N, n) particles at once. States that do not influence the outputs are left out.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import numpy.typing as npt

from flea_diag.core.bond_graph.causal_relation import Relation, algebraic_loops, in_order
from flea_diag.core.symbolic.expression import (
    FUNCTIONS,
    Expression,
    Variable,
    derivative,
    evaluate,
    substitute,
    symbols,
    text,
)
from flea_diag.core.symbolic.generated import compiled
from flea_diag.errors import ModelError, shown

Array = npt.NDArray[np.float64]


@dataclass(frozen=True)
class Linear:
    """x' = A x + B u, y = C x + D u about one point."""

    a: Array
    b: Array
    c: Array
    d: Array


@dataclass(frozen=True)
class StateSpace:
    """State equations with their names.

    ``rates[k]`` is d states[k]/dt and ``readings[k]`` is outputs[k], both in states, inputs
    and parameters only. ``nominal`` holds the parameter values that functions use by default.
    """

    states: tuple[str, ...]
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]
    parameters: tuple[str, ...]
    rates: tuple[Expression, ...]
    readings: tuple[Expression, ...]
    nominal: Mapping[str, float]

    @cached_property
    def nominal_values(self) -> Array:
        """Nominal parameters, shape (k,), in the order of ``parameters``."""
        return np.array([self.nominal[name] for name in self.parameters])

    def derivatives(self, x: Array, u: Array, p: Array | None = None) -> Array:
        """Rates of change.

        Parameters
        ----------
        x : shape (..., n)
            States; any number of leading axes (particles).
        u : shape (..., m)
            Inputs, one row for all particles or one per particle.
        p : shape (..., k), optional
            Parameters; nominal by default, or one row per particle.

        Returns
        -------
        shape (..., n)
        """
        result: Array = self._rate_function(x, u, self.nominal_values if p is None else p)
        return result

    def measure(self, x: Array, u: Array, p: Array | None = None) -> Array:
        """Outputs, shape (..., q); arguments as in ``derivatives``."""
        result: Array = self._reading_function(x, u, self.nominal_values if p is None else p)
        return result

    def linearise(self, x: Array, u: Array, p: Array | None = None) -> Linear:
        """Exact Jacobians at one state, shape (n,), and one input, shape (m,)."""
        values = self.values(x, u, p)
        return Linear(
            gradient(self.rates, self.states, values),
            gradient(self.rates, self.inputs, values),
            gradient(self.readings, self.states, values),
            gradient(self.readings, self.inputs, values),
        )

    def values(self, x: Array, u: Array, p: Array | None = None) -> dict[str, float]:
        """Name -> value of every state, input and parameter at one point."""
        numbers = (*x, *u, *(self.nominal_values if p is None else p))
        names = (*self.states, *self.inputs, *self.parameters)
        return {name: float(number) for name, number in zip(names, numbers, strict=True)}

    def equations(self, tokens: Mapping[str, str] | None = None) -> str:
        """The equations as text, one per line; ``tokens`` maps names to shorter ones."""
        short = {name: Variable(token) for name, token in (tokens or {}).items()}
        rows = [(f"d {name}/dt", rate) for name, rate in zip(self.states, self.rates, strict=True)]
        rows += list(zip(self.outputs, self.readings, strict=True))
        return "\n".join(f"{left} = {substitute(right, short)}" for left, right in rows)

    @cached_property
    def source(self) -> str:
        """Python text of both compiled functions (tanh, exp, fabs, sign and empty are free)."""
        names = (self.states, self.inputs, self.parameters)
        return function_text("rates", names, self.rates) + function_text(
            "readings", names, self.readings
        )

    @cached_property
    def _rate_function(self) -> Any:
        return self._compiled["rates"]

    @cached_property
    def _reading_function(self) -> Any:
        return self._compiled["readings"]

    @cached_property
    def _compiled(self) -> Mapping[str, Any]:
        return compile_functions(self.source)


def gradient(
    expressions: Sequence[Expression], names: Sequence[str], values: Mapping[str, float]
) -> Array:
    """Matrix of exact partial derivatives at one point, shape (expressions, names)."""
    rows = [[float(evaluate(derivative(e, n), values)) for n in names] for e in expressions]
    return np.array(rows, dtype=float).reshape(len(expressions), len(names))


def function_text(
    name: str, arguments: Sequence[Sequence[str]], results: Sequence[Expression]
) -> str:
    """Source of ``name(x, u, p)``: unpack the names used, fill one column per result."""
    used = {n for result in results for n in symbols(result)}
    lines = [f"def {name}(x, u, p):"]
    for array, names in zip("xup", arguments, strict=True):
        lines += [f"    {n} = {array}[..., {k}]" for k, n in enumerate(names) if n in used]
    lines.append(f"    result = empty(x, u, p, {len(results)})")
    lines += [f"    result[..., {k}] = {text(result)}" for k, result in enumerate(results)]
    return "\n".join([*lines, "    return result", "", ""])


def compile_functions(source: str) -> Mapping[str, Any]:
    """Compile generated source; only the functions of the algebra are in scope."""
    return compiled(source, {**FUNCTIONS, "empty": _empty})


def _empty(x: Array, u: Array, p: Array, width: int) -> Array:
    if u.ndim == 1 and p.ndim == 1:
        return np.empty((*x.shape[:-1], width))
    return np.empty((*np.broadcast_shapes(x.shape[:-1], u.shape[:-1], p.shape[:-1]), width))


def state_space(
    relations: Iterable[Relation],
    outputs: Sequence[str],
    nominal: Mapping[str, float],
    where: str = "model",
) -> StateSpace:
    """Derive the equations of the given outputs from causal relations.

    Raises
    ------
    ModelError
        An algebraic loop, or an output that no relation assigns.
    """
    relations = tuple(relations)
    loops = algebraic_loops(relations)
    if loops:
        raise ModelError(
            f"{where}: algebraic loop {' -> '.join((*loops[0], loops[0][0]))};"
            " put a store into it, or merge the resistors"
        )
    solved: dict[str, Expression] = {}
    for relation in in_order(relations):
        solved[relation.target] = substitute(relation.expression, solved)
    missing = [name for name in outputs if name not in solved]
    if missing:
        raise ModelError(f"{where}: no element gives {shown(missing[0])}; add a De or Df for it")
    rates = {r.target: substitute(r.expression, solved) for r in relations if r.temporal}
    readings = tuple(solved[name] for name in outputs)
    states = _needed(rates, readings)
    used = dict.fromkeys(
        name for e in (*(rates[s] for s in states), *readings) for name in symbols(e)
    )
    return StateSpace(
        states,
        tuple(n for n in used if n not in nominal and n not in rates),
        tuple(outputs),
        tuple(n for n in nominal if n in used),
        tuple(rates[s] for s in states),
        readings,
        dict(nominal),
    )


def _needed(rates: Mapping[str, Expression], readings: Sequence[Expression]) -> tuple[str, ...]:
    needed: set[str] = set()
    pending = [name for reading in readings for name in symbols(reading)]
    while pending:
        name = pending.pop()
        if name in rates and name not in needed:
            needed.add(name)
            pending += symbols(rates[name])
    return tuple(name for name in rates if name in needed)
