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

"""Variables of a bond graph in what sensors read, and in the rates of it."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence

from flea_diag.core.bond_graph.actuator_model import Actuator
from flea_diag.core.bond_graph.bond_graph import Bond, BondGraph, Element
from flea_diag.core.symbolic.expression import (
    Expression,
    Variable,
    derivative,
    product,
    symbols,
    total,
)
from flea_diag.errors import ModelError, shown

MECHANICAL = ("rotation", "translation")
"""Domains in which parts move."""
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


class MeasuredGraph:
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
        if element.kind == "0" and node not in seen:
            return self._in_series(bond, element, (*seen, node))
        if element.kind != "TF" or element.law == CONVERTER or node in seen:
            return None
        one, two = self.graph.at(node)
        far = two if bond is one else one
        there = self.graph.elements[far.other(node)]
        known = self.common(there, (*seen, node)) if there.kind == junction.kind else None
        if known is None:
            return None
        ratio = self._ratio(element)
        # f2 = n f1 and e1 = n e2: a flow grows towards port 2, an effort towards port 1.
        towards_two = bond is two
        return known * ratio if towards_two == (junction.kind == "1") else known / ratio

    def _in_series(self, bond: Bond, junction: Element, seen: tuple[str, ...]) -> Expression | None:
        """Flow that a 0-junction passes on, where it has one other bond."""
        passed = self._passed(bond, junction)
        known = self.common(passed[0], seen) if passed else None
        return known if known is None or passed is None else passed[1] * known

    def _passed(self, bond: Bond, junction: Element) -> tuple[Element, int] | None:
        """The 1-junction whose motion a 0-junction passes on, and by which sign."""
        others = [
            other
            for other in self.graph.at(junction.name)
            if other is not bond and not self._left_out(other.other(junction.name))
        ]
        if len(others) != 1:
            return None
        (other,) = others
        there = self.graph.elements[other.other(junction.name)]
        along = (bond.head == junction.name) == (other.tail == junction.name)
        return (there, 1 if along else -1) if there.kind == "1" else None

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
        law, place = self.graph.law(element), self._place(near)
        if place is None or law is None or law.effort is None:
            raise self._open(near, f"the effort of {element.kind} {shown(element.name)}")
        return law.effort(place, p)

    def _place(self, junction: Element, seen: tuple[str, ...] = ()) -> Expression | None:
        """Displacement of a 1-junction, from a sensor on it or on the far side of a gear.

        Or of a spring that is left out: what it gives way is neglected.
        """
        for sensor in self.actuator.sensors.values():
            if sensor.at == junction.name and sensor.integrates:
                return Variable(sensor.channel)
        for bond in self.graph.at(junction.name):
            gear = self.graph.elements[bond.other(junction.name)]
            if gear.kind == "0" and gear.name not in seen:
                passed = self._passed(bond, gear)
                beyond = self._place(passed[0], (*seen, gear.name)) if passed else None
                if passed is not None and beyond is not None:
                    return passed[1] * beyond
            if gear.kind != "TF" or "ratio" not in gear.parameters or gear.name in seen:
                continue
            one, two = self.graph.at(gear.name)
            far = two if bond is one else one
            there = self._place(self.graph.elements[far.other(gear.name)], (*seen, gear.name))
            if there is not None and gear.law != CONVERTER:
                ratio = Variable(gear.parameters["ratio"])
                return there * ratio if bond is two else there / ratio
        return None

    def _ratio(self, element: Element) -> Expression:
        """Of a TF; that of a crank follows the displacement at its port 1."""
        law = self.graph.law(element)
        if law is None or law.ratio is None:
            return Variable(element.parameters["ratio"])
        one, _ = self.graph.at(element.name)
        junction = self.graph.elements[one.other(element.name)]
        place = self._place(junction)
        if place is None:
            raise self._open(junction, f"the angle of {shown(element.name)}")
        p = {role: Variable(name) for role, name in element.parameters.items()}
        return law.ratio(place, p)

    def displacement(self, store: Element) -> Expression:
        """Displacement of a C by the effort that the other elements at its junction leave it."""
        (bond,) = self.graph.at(store.name)
        law, near = self.graph.law(store), self.graph.elements[bond.tail]
        if law is None or law.flow is None or near.kind != "1":
            raise self._open(near, f"the displacement of {store.kind} {shown(store.name)}")
        p = {role: Variable(name) for role, name in store.parameters.items()}
        return law.flow(self.balance(near, bond), p)

    def _two_port_effort(
        self, bond: Bond, element: Element, p: Mapping[str, Expression]
    ) -> Expression:
        one, two = self.graph.at(element.name)
        far = two if bond is one else one
        if element.law == CONVERTER:
            raise self._open(self.graph.elements[bond.other(element.name)], "the effort of a drive")
        if element.kind == "TF":
            inner = self.effort(far, far.other(element.name))
            ratio = self._ratio(element)
            return inner * ratio if bond is one else inner / ratio
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
