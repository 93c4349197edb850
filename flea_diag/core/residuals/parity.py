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

"""Parity relations: the balance at a junction of the bond graph, in measured channels alone.

At a 1-junction the efforts sum to zero, at a 0-junction the flows do. Each term is expressed
by the law of its element in what sensors read (and its time derivatives), through TF and GY
where need be, until no unmeasured variable is left: an analytical redundancy relation. Its
derivative with respect to a parameter or a channel is the regressor of that fault, and the
sign of the regressor its signature. The power of several junctions sums to zero, too: the relation
of a drive of which only the supply current is measured.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from typing import Any

from flea_diag.core.bond_graph.actuator_model import Actuator, ResidualSpec
from flea_diag.core.faults.fault import FaultHypothesis
from flea_diag.core.residuals.measured_graph import (
    MeasuredGraph,
    channel_of,
    rate_symbol,
)
from flea_diag.core.symbolic.expression import (
    ONE,
    ZERO,
    Expression,
    Function,
    Variable,
    apply,
    derivative,
    evaluate,
    rewritten,
    symbols,
    total,
)
from flea_diag.errors import ModelError


@dataclass(frozen=True)
class ParityRelation:
    """r = expression: zero without a fault, in channels, their derivatives and parameters."""

    name: str
    unit: str
    expression: Expression
    nominal: Mapping[str, float]
    motion: Expression
    """The flow whose sign is the direction of motion, in measured channels."""

    @cached_property
    def arguments(self) -> tuple[str, ...]:
        """Channel symbols to be given: ``motor_current``, ``d_motor_current``, ..."""
        return tuple(n for n in symbols(self.expression) if n not in self.nominal)

    @cached_property
    def channels(self) -> tuple[str, ...]:
        """Channels that the relation reads."""
        return tuple(dict.fromkeys(channel_of(name)[0] for name in self.arguments))

    @cached_property
    def sided(self) -> tuple[str, ...]:
        """Channels of which it reads nothing but the side, through a smooth sign."""
        bare = rewritten(self.expression, lambda e: ONE if isinstance(e, Function) else e)
        kept = {channel_of(name)[0] for name in symbols(bare)}
        return tuple(name for name in self.channels if name not in kept)

    @cached_property
    def parameters(self) -> tuple[str, ...]:
        """Parameters that the relation depends on."""
        return tuple(n for n in symbols(self.expression) if n in self.nominal)

    def __call__(
        self, readings: Mapping[str, Any], parameters: Mapping[str, Any] | None = None
    ) -> Any:
        """Value for numbers or arrays of one shape, by argument name, in ``unit``."""
        values: dict[str, Any] = {**self.nominal, **(parameters or {}), **readings}
        return evaluate(self.expression, values)

    def regressor(self, cause: FaultHypothesis) -> Expression:
        """Change of the residual per unit of the fault, in its + direction.

        The unit is that of the parameter; for a sensor that of the channel (bias), of the
        channel per second (drift, apart from a part that grows with time), 1 (scaling, dead).
        A parameter acts against its own term, a sensor with it.
        """
        r = self.expression
        if not cause.mode:
            return -derivative(r, cause.name)
        return _SENSOR_REGRESSOR[cause.mode](r, cause.name)

    def growth(self, cause: FaultHypothesis) -> Expression:
        """The part of a drift's effect that grows with time: per unit and second."""
        return derivative(self.expression, cause.name) if cause.mode == "drift" else ZERO

    def normalised(self, name: str) -> ParityRelation:
        """The relation times the sign of motion: parameter faults then keep their sign."""
        signed = self.expression * apply("sign", self.motion)
        return replace(self, name=name, expression=signed)


@lru_cache(maxsize=1024)
def _scaling(r: Expression, channel: str) -> Expression:
    name, terms = channel, []
    for _ in range(3):
        terms.append(derivative(r, name) * Variable(name))
        name = rate_symbol(name)
    return total(terms)


_SENSOR_REGRESSOR: dict[str, Callable[[Expression, str], Expression]] = {
    "bias": derivative,
    "drift": lambda r, channel: derivative(r, rate_symbol(channel)),
    "scaling": _scaling,
    "dead": lambda r, channel: -_scaling(r, channel),
    "dropout": lambda r, channel: -_scaling(r, channel),
    "noise": lambda r, channel: ZERO,
}


def parity_relation(actuator: Actuator, spec: ResidualSpec) -> ParityRelation:
    """Relation of a residual of kind ``junction``, ``power`` or ``difference``.

    Raises
    ------
    ModelError
        When the sensors of the actuator do not close the balance; it names what is missing.
    """
    nominal = actuator.graph.values()
    if spec.kind == "difference":
        return ParityRelation(spec.name, spec.unit, _difference(actuator, spec), nominal, ZERO)
    measured = MeasuredGraph(actuator, spec.without)
    if spec.kind == "power":
        balance = measured.power(spec.junctions)
    else:
        balance = measured.balance(actuator.graph.elements[spec.junction], None)
    if spec.divided_by:
        balance = balance / Variable(spec.divided_by)
    moving = actuator.graph.elements.get(spec.motion or spec.junction)
    motion = (measured.common(moving) if moving else None) or ZERO
    made = ParityRelation(spec.name, spec.unit, balance, nominal, motion)
    return made.normalised(spec.name) if spec.normalised else made


def junction_balance(actuator: Actuator, junction: str) -> Expression:
    """Sum of efforts or flows into a junction, in channels.

    Raises
    ------
    ModelError
        The sensors of the actuator do not close it.
    """
    return MeasuredGraph(actuator).balance(actuator.graph.elements[junction], None)


def _difference(actuator: Actuator, spec: ResidualSpec) -> Expression:
    """Two readings of one quantity, the reference up to a gain, and what lies between them.

    Without a reference a reading is held against the parameter that it reads while healthy.
    """
    if not spec.reference:
        return Variable(spec.channel) - Variable(spec.offset)
    one, other = _common_terms(actuator, spec.channel, spec.reference)
    if spec.supplied_by:
        supply = actuator.supplies[spec.supplied_by]
        # A scale, not the parameter: a supply that sags is read, and leaves this relation alone.
        level = actuator.graph.parameters[actuator.residuals[supply.residual].offset].value
        other = other * Variable(supply.channel) / level
    gap = one - (Variable(spec.gain) * other if spec.gain else other)
    if spec.across:
        lost = actuator.graph.elements[spec.across].kind == "R"
        gap = gap + _lost(actuator, spec) if lost else gap - _between(actuator, spec)
    return gap - Variable(spec.offset) if spec.offset else gap


def _lost(actuator: Actuator, spec: ResidualSpec) -> Expression:
    """Effort of the resistor on the way from the source of the reference to the channel."""
    graph = actuator.graph
    (bond,) = graph.at(spec.across)
    held = bond.other(spec.across)
    led = [other.other(held) for other in graph.at(held)]
    fed = any(graph.elements[name].signal == spec.reference for name in led)
    if graph.elements[held].kind != "1" or not fed or actuator.sensors[spec.channel].at not in led:
        raise ModelError(
            f"{actuator.name}: residual {spec.name}: no 1-junction joins the source of "
            f"{spec.reference}, {spec.across} and the place of {spec.channel}; name a resistor "
            "between them under across"
        )
    return MeasuredGraph(actuator, spec.without).effort(bond, spec.across)


def _between(actuator: Actuator, spec: ResidualSpec) -> Expression:
    """Displacement of the store that lies between the junction of the channel and the other.

    Its junction hangs on the 0-junction that the one of the channel leads to.
    """
    graph, place = actuator.graph, actuator.sensors[spec.channel].at
    (held,) = graph.at(spec.across)
    for bond in graph.at(held.tail):
        fork = bond.other(held.tail)
        led = next((b for b in graph.at(fork) if b.other(fork) == place), None)
        if graph.elements[fork].kind == "0" and led is not None:
            along = (led.head == fork) == (bond.tail == fork)
            stretch = MeasuredGraph(actuator, spec.without).displacement(
                graph.elements[spec.across]
            )
            return stretch if along else -stretch
    raise ModelError(
        f"{actuator.name}: residual {spec.name}: no 0-junction joins {place}, where {spec.channel} "
        f"is, with {spec.across}; name a store beside it under across"
    )


def _common_terms(
    actuator: Actuator, channel: str, reference: str
) -> tuple[Expression, Expression]:
    """A flow beside a displacement is held against its rate, seen at the same junction."""
    one, other = (actuator.sensors.get(name) for name in (channel, reference))
    if one is None or other is None or one.integrates or not other.integrates:
        return Variable(channel), Variable(reference)
    place = actuator.graph.elements[other.at]
    seen = MeasuredGraph(actuator.with_sensors([channel])).common(place)
    if seen is None:
        raise ModelError(
            f"{actuator.name}: {channel} is not known at {other.at!r}, where {reference} is; "
            "compare sensors that a transformer joins"
        )
    return seen, Variable(rate_symbol(reference))
