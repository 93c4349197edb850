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

"""Sign propagation on the temporal causal graph: backward to hypotheses, forward to effects.

Signs are ``+``, ``-``, ``0`` and ``*`` (either: two paths of the same order disagree).
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

from flea_diag.core.causal_graph.operating_point import sign_of
from flea_diag.core.causal_graph.temporal_causal_graph import Edge, TemporalCausalGraph
from flea_diag.core.faults.fault import FaultHypothesis

MAX_ORDER = 6  # assumption: slower responses count as none
SYMBOL = {1: "+", -1: "-", 0: "0"}
FLIP = {"+": "-", "-": "+", "0": "0", "*": "*"}


def scaled(symbol: str, sign: int) -> str:
    """A symbol times a sign."""
    return "0" if sign == 0 else (symbol if sign > 0 else FLIP[symbol])


def combined(symbols: Iterable[str]) -> str:
    """Sign of the sum of effects of one order; ``*`` when they oppose each other."""
    kinds = set(symbols)
    kinds.discard("0")
    if not kinds:
        return "0"
    return kinds.pop() if len(kinds) == 1 else "*"


@dataclass(frozen=True)
class InitialDeviation:
    """Initial deviation of a vertex: abrupt (order 0) or incipient (order 1 and higher)."""

    vertex: str
    order: int
    symbol: str
    cause: str


@dataclass(frozen=True)
class Effect:
    """Effect on one vertex: the sign of each derivative, and the path of the first one."""

    signs: str
    path: str

    @property
    def order(self) -> int:
        """Order of the first effect, -1 when there is none."""
        return next((k for k, symbol in enumerate(self.signs) if symbol != "0"), -1)


def initial_deviations(
    graph: TemporalCausalGraph, cause: FaultHypothesis, values: Mapping[str, float], ramp: bool
) -> tuple[InitialDeviation, ...]:
    """Vertices that a deviating parameter or input acts on; a ramp acts one order later."""
    late, sign = int(ramp), cause.direction
    if cause.name in graph.inputs:
        return (InitialDeviation(cause.name, late, SYMBOL[sign], str(cause)),)
    return tuple(
        InitialDeviation(e.target, late + e.temporal, SYMBOL[sign * e.sign(values)], str(cause))
        for e in graph.of_parameter.get(cause.name, ())
    )


def propagate_forward(
    graph: TemporalCausalGraph,
    entering: Iterable[InitialDeviation],
    values: Mapping[str, float],
) -> dict[str, Effect]:
    """Effect on every vertex: order by order, instantaneous edges within an order.

    An instantaneous edge keeps the order, a temporal one raises it by one; contributions of
    the same order add up (Mosterman and Biswas 1999).
    """
    begun: dict[tuple[str, int], list[tuple[str, str]]] = {}
    for each in entering:
        begun.setdefault((each.vertex, each.order), []).append((each.symbol, each.cause))
    signed = {
        v: [(e.source, e.temporal, sign) for e in graph.into[v] if (sign := e.sign(values))]
        for v in graph.vertices
    }
    found: dict[tuple[str, int], tuple[str, str]] = {}
    for order in range(MAX_ORDER + 1):
        for vertex, edges in signed.items():
            parts = begun.get((vertex, order), []).copy()
            for source, temporal, sign in edges:
                before = found.get((source, order - temporal))
                if before is not None:
                    parts.append((scaled(before[0], sign), before[1]))
            symbol = combined([s for s, _ in parts]) if parts else "0"
            if symbol != "0":
                first = next(path for s, path in parts if s != "0")
                found[vertex, order] = (symbol, f"{first} -> {vertex}{symbol}")
    return {v: _effect(v, found) for v in graph.vertices}


def _effect(vertex: str, found: Mapping[tuple[str, int], tuple[str, str]]) -> Effect:
    row = [found.get((vertex, order), ("0", "")) for order in range(MAX_ORDER + 1)]
    return Effect("".join(symbol for symbol, _ in row), next((p for _, p in row if p), ""))


@dataclass(frozen=True)
class Suspicion:
    """A hypothesis from backward propagation, the path to it, and its temporal distance."""

    hypothesis: FaultHypothesis
    path: tuple[str, ...]
    order: int

    def __str__(self) -> str:
        return f"{self.hypothesis}  (order {self.order}: {' <- '.join(self.path)})"


def propagate_backward(
    graph: TemporalCausalGraph,
    measurement: str,
    symbol: str,
    values: Mapping[str, float],
    complete: bool = False,
) -> tuple[Suspicion, ...]:
    """Every parameter and input whose change would explain a deviating measurement.

    Instantaneous edges are followed before temporal ones, order after order, and the first
    label of a vertex stands (TRANSCEND). With ``complete`` a vertex may be reached with both
    signs, so that a parameter on two paths of opposite sign is suspected both ways. The sensor
    itself is suspected too. At a steady point nothing acts on a store; an I or C is then
    suspected as it would show while its state grows (an inertia while it speeds up).
    """
    labelled: dict[str, set[str]] = {}
    own = FaultHypothesis(measurement, 1 if symbol == "+" else -1, "sensor")
    found = {own: Suspicion(own, (f"{measurement}{symbol}",), 0)}
    frontier: list[tuple[str, str, tuple[str, ...]]] = [(measurement, symbol, ())]
    order = 0
    while frontier:
        later: list[tuple[str, str, tuple[str, ...]]] = []
        while frontier:
            vertex, sign, path = frontier.pop(0)
            seen = labelled.setdefault(vertex, set())
            if sign in seen or (seen and not complete):
                continue
            seen.add(sign)
            here = (*path, f"{vertex}{sign}")
            for edge in graph.parameters_into.get(vertex, ()):
                _suspect(found, edge, sign, here, order, values)
            if vertex in graph.inputs:
                cause = FaultHypothesis(vertex, 1 if sign == "+" else -1)
                found.setdefault(cause, Suspicion(cause, here, order))
            for edge in graph.into.get(vertex, ()):
                before = scaled(sign, edge.sign(values))
                if before != "0":
                    (later if edge.temporal else frontier).append((edge.source, before, here))
        frontier, order = later, order + 1
    return tuple(found.values())


def _suspect(
    found: dict[FaultHypothesis, Suspicion],
    edge: Edge,
    sign: str,
    path: tuple[str, ...],
    order: int,
    values: Mapping[str, float],
) -> None:
    gain = edge.sign(values)
    if edge.temporal and not gain:
        gain = -sign_of(values[edge.target])
    direction = scaled(sign, gain)
    if direction != "0":
        cause = FaultHypothesis(edge.source, 1 if direction == "+" else -1)
        found.setdefault(cause, Suspicion(cause, path, order + edge.temporal))
