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

"""Bond graphs as frozen data: elements, junctions, bonds with half-arrows.

Elements are Se, Sf, MSe, MSf (sources), I, C, R, TF, GY, De, Df (detectors) and 0- and
1-junctions (Narasimhan et al. 2010, section 3.1). A bond ``a -> b`` counts power from a to b
as positive. The domain (what effort and flow are) is declared at junctions and inherited.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Annotated

from flea_diag.core.bond_graph.law import DEFAULT_LAW, LAWS, Law
from flea_diag.fields.values import WrittenAs

JUNCTIONS = ("0", "1")
SOURCES = ("Se", "Sf", "MSe", "MSf")
STORES = ("I", "C")
PASSIVE = ("I", "C", "R")
TWO_PORTS = ("TF", "GY")
DETECTORS = ("De", "Df")
KINDS = (*SOURCES, *PASSIVE, *TWO_PORTS, *DETECTORS, *JUNCTIONS)

DOMAINS: dict[str, tuple[str, str]] = {
    "electrical": ("V", "A"),
    "rotation": ("N*m", "rad/s"),
    "translation": ("N", "m/s"),
    "thermal": ("K", "W"),
    "hydraulic": ("Pa", "m^3/s"),
}
"""Units of effort and flow. ``thermal`` is a pseudo bond graph: temperature and heat flow."""


@dataclass(frozen=True)
class Parameter:
    """One constant of the model: SI value, unit, printed symbol and source."""

    name: str
    value: float
    unit: str
    symbol: str = ""
    note: str = ""


@dataclass(frozen=True)
class Element:
    """One node of the graph.

    ``parameters`` maps the roles of the law to parameter names; ``signal`` is the input of a
    source or the channel of a detector; ``powers`` names the R elements whose dissipation an
    MSf carries; ``state`` names the variable of a store, or of a detector that integrates;
    ``modulated_by`` names the junction whose common variable a modulated law depends on.
    """

    name: str
    kind: Annotated[str, WrittenAs("type")]
    domain: str = ""
    law: str = ""
    parameters: Mapping[str, str] = field(default_factory=dict)
    signal: str = ""
    state: str = ""
    powers: tuple[str, ...] = ()
    integrates: bool = False
    modulated_by: str = ""


@dataclass(frozen=True)
class Bond:
    """Power bond with its half-arrow from ``tail`` to ``head``."""

    name: str
    tail: str
    head: str

    @property
    def effort(self) -> str:
        """Name of its effort variable."""
        return f"e_{self.name}"

    @property
    def flow(self) -> str:
        """Name of its flow variable."""
        return f"f_{self.name}"

    def other(self, end: str) -> str:
        """The node at the other end."""
        return self.head if end == self.tail else self.tail


@dataclass(frozen=True)
class BondGraph:
    """Elements, bonds and parameters of one actuator, validated by ``bond_graph``."""

    name: str
    elements: Mapping[str, Element]
    bonds: tuple[Bond, ...]
    parameters: Mapping[str, Parameter]

    def at(self, node: str) -> tuple[Bond, ...]:
        """Bonds of one node; of a TF or GY, port 1 (half-arrow in) comes first."""
        bonds = [bond for bond in self.bonds if node in (bond.tail, bond.head)]
        if self.elements[node].kind in TWO_PORTS:
            bonds.sort(key=lambda bond: bond.tail == node)
        return tuple(bonds)

    def of_kind(self, *kinds: str) -> tuple[Element, ...]:
        """Elements of the given kinds, in order of definition."""
        return tuple(e for e in self.elements.values() if e.kind in kinds)

    def law(self, element: Element) -> Law | None:
        """Constituent law of an element, None for junctions, detectors and plain sources."""
        return LAWS.get(element.law or DEFAULT_LAW.get(element.kind, ""))

    def domain(self, bond: Bond) -> str:
        """Domain of a bond: that of the junction at one of its ends."""
        return self.elements[bond.tail].domain or self.elements[bond.head].domain

    def values(self) -> dict[str, float]:
        """Nominal value of every parameter, SI."""
        return {name: parameter.value for name, parameter in self.parameters.items()}

    def tokens(self) -> dict[str, str]:
        """Short symbol of every parameter that has one, for printing."""
        return {name: p.symbol for name, p in self.parameters.items() if p.symbol}
