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

"""Relations by prediction: the equation of one slow store, with measured neighbours as inputs.

    d x/dt = supply + sum of exchange * (neighbour - x)

The derivative of a temperature would be noise, so the balance at its junction is not evaluated but
integrated (``thermal``): it is solved for the rate of the store. What flows in without a difference
of potential is the supply; what flows between the store and a measured neighbour is exchange.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

from flea_diag.core.bond_graph.actuator_model import Actuator, ResidualSpec
from flea_diag.core.bond_graph.bond_graph import Bond, BondGraph
from flea_diag.core.residuals.measured_graph import rate_symbol
from flea_diag.core.residuals.parity import junction_balance
from flea_diag.core.symbolic.collect import expand
from flea_diag.core.symbolic.expression import (
    ZERO,
    Expression,
    Variable,
    derivative,
    substitute,
    symbols,
    total,
)
from flea_diag.errors import ModelError, shown


@dataclass(frozen=True)
class Prediction:
    """How fast a store changes: expressions in signals and base parameters."""

    name: str
    unit: str
    channel: str
    supply: Expression
    """Unit of the channel per second."""
    exchange: Mapping[str, Expression]
    """Neighbouring channel -> 1/s, in parameters alone."""

    @property
    def rate(self) -> Expression:
        """Of the channel, in signals; the channel itself stands for the estimate."""
        own = Variable(self.channel)
        flows = (rate * (Variable(name) - own) for name, rate in self.exchange.items())
        return total((self.supply, *flows))

    @property
    def warm(self) -> Mapping[str, Expression]:
        """Channel -> where it comes to rest: it gives neighbours, at zero, what supplies it."""
        leaves = total(self.exchange.values())
        own = ZERO if leaves == ZERO else self.supply / leaves
        return {**dict.fromkeys(self.exchange, ZERO), self.channel: own}


def prediction(actuator: Actuator, spec: ResidualSpec) -> Prediction:
    """Relation of a residual of kind ``prediction``, in the parameters of the graph.

    A channel that reads an input of the graph has no equation: it is
    predicted to stay what it is.

    Raises
    ------
    ModelError
        The sensors do not close the balance, or the store exchanges with what no sensor reads.
    """
    rate = _rate(actuator, spec)
    same = actuator.units[spec.channel]
    around = [n for n in symbols(rate) if n != spec.channel and actuator.units.get(n) == same]
    exchange = {name: derivative(rate, name) for name in around}
    leak = total((derivative(rate, spec.channel), *exchange.values()))
    bound = any(set(symbols(e)) & set(actuator.units) for e in exchange.values())
    if expand(leak) != ZERO or bound:
        raise ModelError(
            f"{actuator.name}: residual {shown(spec.name)}: what {spec.channel} exchanges is not"
            " in proportion to the difference from what other sensors read; add a sensor there"
        )
    supply = substitute(rate, dict.fromkeys((spec.channel, *around), ZERO))
    return Prediction(spec.name, spec.unit, spec.channel, supply, exchange)


def _rate(actuator: Actuator, spec: ResidualSpec) -> Expression:
    """The balance at the junction of the sensor, solved for the rate of the store there."""
    sensor = actuator.sensors[spec.channel]
    if not sensor.at:
        return ZERO
    graph = lumped(actuator.graph, sensor.at, spec.lumped)
    stored = -junction_balance(replace(actuator, graph=graph), sensor.at)
    rate = rate_symbol(spec.channel)
    inertia = derivative(stored, rate)
    if inertia == ZERO:
        raise ModelError(
            f"{actuator.name}: residual {shown(spec.name)}: no store at {shown(sensor.at)}, where "
            f"{spec.channel} is read; a prediction needs one"
        )
    absent: dict[str, Expression] = dict.fromkeys((*spec.neglected, rate), ZERO)
    return -substitute(stored, absent) / inertia


def lumped(graph: BondGraph, place: str, stores: Sequence[str]) -> BondGraph:
    """The graph with these stores at one junction, and without the paths between them."""
    merged = {bond.other(store) for store in stores for bond in graph.at(store)}
    between = {
        element.name
        for element in graph.of_kind("0", "1")
        if element.name not in merged
        and (ends := _junctions_beside(graph, element.name))
        and len(ends) > 1
        and ends <= merged
    }
    bonds = tuple(
        Bond(b.name, *(place if end in merged else end for end in (b.tail, b.head)))
        for b in graph.bonds
        if not between & {b.tail, b.head}
    )
    return replace(graph, bonds=bonds)


def _junctions_beside(graph: BondGraph, name: str) -> set[str]:
    """Neighbours that are neither resistors nor detectors."""
    beside = (bond.other(name) for bond in graph.at(name))
    return {node for node in beside if graph.elements[node].kind not in ("R", "De", "Df")}
