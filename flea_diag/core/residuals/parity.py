"""Parity relations: the balance at a junction of the bond graph, in measured channels alone.

At a 1-junction the efforts sum to zero, at a 0-junction the flows do. Each term is expressed
by the law of its element in what sensors read (and its time derivatives), through TF and GY
where need be, until no unmeasured variable is left: an analytical redundancy relation. Its
derivative with respect to a parameter or a channel is the regressor of that fault, and the
sign of the regressor its signature. The power of several junctions sums to zero, too: the relation
of a drive of which only the supply current is measured.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

from flea_diag.core.bond_graph.actuator_model import Actuator, ResidualSpec
from flea_diag.core.bond_graph.bond_graph import Bond, BondGraph, Element
from flea_diag.core.faults.fault import FaultHypothesis
from flea_diag.core.symbolic.expression import (
    ZERO,
    Expression,
    Variable,
    apply,
    derivative,
    evaluate,
    product,
    symbols,
    total,
)
from flea_diag.errors import ModelError, shown

CONVERTER = "converter"
"""Law of a two-port of which only the power is known."""


def rate_symbol(name: str) -> str:
    """Symbol of the time derivative of a channel, or of such a derivative."""
    return f"d_{name}"


def channel_of(symbol: str) -> tuple[str, int]:
    """Channel and order of derivative that a symbol stands for."""
    order = 0
    while symbol.startswith("d_"):
        symbol, order = symbol[2:], order + 1
    return symbol, order


def time_derivative(expression: Expression, constants: frozenset[str]) -> Expression:
    """d/dt of an expression in channels, by the chain rule."""
    return total(
        derivative(expression, name) * Variable(rate_symbol(name))
        for name in symbols(expression)
        if name not in constants
    )


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
    measured = _Measured(actuator, spec.without)
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
    return _Measured(actuator).balance(actuator.graph.elements[junction], None)


def _difference(actuator: Actuator, spec: ResidualSpec) -> Expression:
    """Two readings of one quantity, the reference up to a gain, and an offset between them."""
    one, other = _common_terms(actuator, spec.channel, spec.reference)
    gap = one - (Variable(spec.gain) * other if spec.gain else other)
    return gap - Variable(spec.offset) if spec.offset else gap


def _common_terms(
    actuator: Actuator, channel: str, reference: str
) -> tuple[Expression, Expression]:
    """A flow beside a displacement is held against its rate, seen at the same junction."""
    one, other = (actuator.sensors.get(name) for name in (channel, reference))
    if one is None or other is None or one.integrates or not other.integrates:
        return Variable(channel), Variable(reference)
    place = actuator.graph.elements[other.at]
    seen = _Measured(actuator.with_sensors([channel])).common(place)
    if seen is None:
        raise ModelError(
            f"{actuator.name}: {channel} is not known at {other.at!r}, where {reference} is; "
            "compare sensors that a transformer joins"
        )
    return seen, Variable(rate_symbol(reference))


class _Measured:
    """Variables of the graph expressed in channels, as far as sensors allow."""

    def __init__(self, actuator: Actuator, without: Collection[str] = ()) -> None:
        self.actuator = actuator
        self.without = without
        self.graph: BondGraph = actuator.graph
        self.constants = frozenset(actuator.graph.parameters)

    def balance(self, junction: Element, without: Bond | None) -> Expression:
        """Sum of efforts (1-junction) or flows (0-junction) into a junction, less one bond."""
        term = self.effort if junction.kind == "1" else self.flow
        return total(
            (1 if bond.head == junction.name else -1) * term(bond, bond.other(junction.name))
            for bond in self.graph.at(junction.name)
            if bond is not without and not self._left_out(bond.other(junction.name))
        )

    def power(self, junctions: Sequence[str]) -> Expression:
        """Sum of power into several junctions: what passes between them is not in it.

        Junctions and two-ports neither store nor lose power, so what happens inside a two-port
        that joins two of the junctions, such as a switched drive, need not be known.
        """
        terms = []
        for name in junctions:
            junction = self.graph.elements[name]
            flowing = self.effort if junction.kind == "1" else self.flow
            for bond in self.graph.at(name):
                far = bond.other(name)
                if not self._left_out(far) and not self._between(far, junctions):
                    sense = 1 if bond.head == name else -1
                    terms.append(sense * (flowing(bond, far) * self._known(junction)))
        return total(terms)

    def _between(self, name: str, junctions: Collection[str]) -> bool:
        """One of the junctions, or a two-port with both ends at one."""
        if self.graph.elements[name].kind not in ("TF", "GY"):
            return name in junctions
        return all(bond.other(name) in junctions for bond in self.graph.at(name))

    def common(self, junction: Element, seen: tuple[str, ...] = ()) -> Expression | None:
        """The common variable of a junction from a sensor on it, or on the far side of a TF."""
        own = [s for s in self.actuator.sensors.values() if s.at == junction.name]
        for sensor in sorted(own, key=lambda s: s.integrates):
            known = sensor.reading
            return time_derivative(known, self.constants) if sensor.integrates else known
        for bond in self.graph.at(junction.name):
            found = self._through(bond, bond.other(junction.name), junction, seen)
            if found is not None:
                return found
        return None

    def _through(
        self, bond: Bond, node: str, junction: Element, seen: tuple[str, ...]
    ) -> Expression | None:
        element = self.graph.elements[node]
        if element.kind != "TF" or element.law == CONVERTER or node in seen:
            return None
        one, two = self.graph.at(node)
        far = two if bond is one else one
        there = self.graph.elements[far.other(node)]
        known = self.common(there, (*seen, node)) if there.kind == junction.kind else None
        if known is None:
            return None
        ratio = Variable(element.parameters["ratio"])
        # f2 = n f1 and e1 = n e2: a flow grows towards port 2, an effort towards port 1.
        towards_two = bond is two
        return known * ratio if towards_two == (junction.kind == "1") else known / ratio

    def effort(self, bond: Bond, far: str) -> Expression:
        """Effort on a bond as the node at its far end makes it."""
        element, near = self.graph.elements[far], self.graph.elements[bond.other(far)]
        p = {role: Variable(name) for role, name in element.parameters.items()}
        if element.kind == "I":
            return p["inertia"] * time_derivative(self._known(near), self.constants)
        if element.kind == "R":
            law = self.graph.law(element)
            assert law is not None
            assert law.effort is not None
            return law.effort(self._known(near), self._modulated(element, p))
        if element.law == "constant_effort":
            return p["level"]
        if element.kind in ("Se", "MSe"):
            signal = Variable(element.signal)
            return p["gain"] * signal if element.law == "gain" else signal
        if element.kind == "0":
            return self._known(element)
        if element.kind == "1":
            sense = 1 if bond.tail == far else -1
            return sense * self.balance(element, bond)
        if element.kind in ("TF", "GY"):
            return self._two_port_effort(bond, element, p)
        return self._compliance(element, near, p)

    def _compliance(
        self, element: Element, near: Element, p: Mapping[str, Expression]
    ) -> Expression:
        for sensor in self.actuator.sensors.values():
            if sensor.at == near.name and sensor.integrates and "stiffness" in p:
                return p["stiffness"] * Variable(sensor.channel)
        raise self._open(near, f"the effort of {element.kind} {shown(element.name)}")

    def _two_port_effort(
        self, bond: Bond, element: Element, p: Mapping[str, Expression]
    ) -> Expression:
        one, two = self.graph.at(element.name)
        far = two if bond is one else one
        if element.law == CONVERTER:
            raise self._open(self.graph.elements[bond.other(element.name)], "the effort of a drive")
        if element.kind == "TF":
            inner = self.effort(far, far.other(element.name))
            return inner * p["ratio"] if bond is one else inner / p["ratio"]
        role = ("back_emf" if bond is one else "torque") if "torque" in p else "modulus"
        return p[role] * self._known(self.graph.elements[far.other(element.name)])

    def flow(self, bond: Bond, far: str) -> Expression:
        """Flow on a bond of a 0-junction as the node at its far end makes it."""
        element, near = self.graph.elements[far], self.graph.elements[bond.other(far)]
        p = {role: Variable(name) for role, name in element.parameters.items()}
        if element.kind == "C" and "capacity" in p:
            return p["capacity"] * time_derivative(self._known(near), self.constants)
        if element.law == "dissipation":
            return p["share"] * total(self._power(name) for name in element.powers)
        if element.kind in ("Sf", "MSf"):
            signal = Variable(element.signal)
            return p["gain"] * signal if element.law == "gain" else signal
        if element.kind == "1":
            return self.common(element) or self._series_flow(bond, element)
        raise self._open(near, f"the flow of {element.kind} {shown(element.name)}")

    def _series_flow(self, bond: Bond, junction: Element) -> Expression:
        """Flow of a 1-junction from the one resistor on it and the efforts around it."""
        for branch in self.graph.at(junction.name):
            element = self.graph.elements[branch.other(junction.name)]
            law = self.graph.law(element)
            if element.kind == "R" and law is not None and law.flow is not None:
                p = {role: Variable(name) for role, name in element.parameters.items()}
                return law.flow(self.balance(junction, branch), self._modulated(element, p))
        raise self._open(junction, "its flow")

    def _modulated(self, element: Element, p: Mapping[str, Expression]) -> Mapping[str, Expression]:
        """Its parameters, with the variable that modulates it."""
        if not element.modulated_by:
            return p
        return {**p, "by": self._known(self.graph.elements[element.modulated_by])}

    def _power(self, name: str) -> Expression:
        (bond,) = self.graph.at(name)
        near = self.graph.elements[bond.other(name)]
        return product((self.effort(bond, name), self._known(near)))

    def _known(self, junction: Element) -> Expression:
        found = self.common(junction)
        if found is None:
            found = self._imposed(junction)
        if found is None:
            raise self._open(junction, "its common variable")
        return found

    def _imposed(self, junction: Element) -> Expression | None:
        """Effort of a 0-junction that an ideal source imposes, such as a load that is commanded."""
        for bond in self.graph.at(junction.name):
            element = self.graph.elements[bond.other(junction.name)]
            if junction.kind == "0" and element.kind == "MSe" and not element.law:
                return Variable(element.signal)
        return None

    def _open(self, junction: Element, what: str) -> ModelError:
        return ModelError(
            f"{self.actuator.name}: no parity relation, at {junction.kind}-junction"
            f" {shown(junction.name)} {what} is not measured; add a sensor there"
        )

    def _left_out(self, name: str) -> bool:
        return name in self.without or self.graph.elements[name].kind in ("De", "Df")
