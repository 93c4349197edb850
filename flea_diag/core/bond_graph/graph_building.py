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

"""Bond graphs are built once, and all that is wrong with one is found then."""

from __future__ import annotations

import keyword
import math
from collections import Counter
from collections.abc import Mapping
from dataclasses import replace

from flea_diag.core.bond_graph.bond_graph import (
    DETECTORS,
    DOMAINS,
    JUNCTIONS,
    KINDS,
    PASSIVE,
    SOURCES,
    TWO_PORTS,
    Bond,
    BondGraph,
    Element,
    Parameter,
)
from flea_diag.core.bond_graph.law import LAWS, Law, Ports
from flea_diag.core.symbolic.expression import FUNCTIONS
from flea_diag.core.symbolic.unit import dimension, spelled
from flea_diag.errors import ConfigurationError, ModelError, shown


def bond_graph(
    name: str,
    elements: tuple[Element, ...],
    arrows: tuple[tuple[str, str], ...],
    parameters: tuple[Parameter, ...],
) -> BondGraph:
    """Build and validate a graph from elements, (tail, head) pairs and parameters.

    Raises
    ------
    ConfigurationError
        An unknown kind, law, role or unit, or a value out of its range.
    ModelError
        Invalid structure: dangling bonds, wrong ports, wrong half-arrows.
    """
    _refuse_repeats(name, [e.name for e in elements], "element")
    _refuse_repeats(name, [p.name for p in parameters], "parameter")
    by_name = {element.name: element for element in elements}
    for element in elements:
        if element.kind not in KINDS:
            raise ConfigurationError(
                f"{name}: element {shown(element.name)} has unknown type {shown(element.kind)},"
                f" known are {', '.join(KINDS)}"
            )
    for tail, head in arrows:
        _check_ends(name, by_name, tail, head)
    bonds = tuple(Bond(_bond_name(by_name, tail, head), tail, head) for tail, head in arrows)
    _refuse_repeats(name, [bond.name for bond in bonds], "bond")
    graph = BondGraph(name, by_name, bonds, {p.name: p for p in parameters})
    _check_variables(graph)
    for bond in bonds:
        _check_domain(graph, bond)
    for element in elements:
        _check_ports(graph, element)
        _check_law(graph, element)
    return graph


def _bond_name(elements: Mapping[str, Element], tail: str, head: str) -> str:
    for end, port in ((tail, "_2"), (head, "_1")):
        if elements[end].kind in TWO_PORTS:
            return end + port
    for end in (tail, head):
        if elements[end].kind not in JUNCTIONS:
            return end
    return f"{tail}_{head}"


def _refuse_repeats(graph: str, names: list[str], what: str) -> None:
    for name, count in Counter(names).items():
        if count > 1:
            raise ConfigurationError(
                f"{graph}: {what} {shown(name)} is given {count} times, name it once"
            )
        _check_name(graph, name, what)


RESERVED = (*FUNCTIONS, "x", "u", "p", "result", "empty")
"""Names reserved for the compiled equations."""


def _check_name(graph: str, name: str, what: str) -> None:
    """Refuse names that are not identifiers or are reserved: they go into compiled equations."""
    if not name.isidentifier() or keyword.iskeyword(name) or name in RESERVED:
        raise ConfigurationError(
            f"{graph}: {what} {shown(name)} cannot be a name; use letters, digits and underscores,"
            f" and none of {', '.join(RESERVED)}"
        )


def _check_variables(graph: BondGraph) -> None:
    """Parameters, states, channels and the efforts and flows of bonds must not share a name."""
    elements = graph.elements.values()
    inputs = {e.signal for e in elements if e.kind in SOURCES and e.signal}
    named = [("parameter", name) for name in graph.parameters]
    named += [("input", name) for name in inputs]
    named += [("channel", e.signal) for e in elements if e.kind in DETECTORS]
    named += [("state", e.state) for e in elements if e.state]
    named += [("variable", name) for bond in graph.bonds for name in (bond.effort, bond.flow)]
    taken: dict[str, str] = {}
    for what, name in named:
        _check_name(graph.name, name, what)
        if name in taken:
            raise ConfigurationError(
                f"{graph.name}: {shown(name)} is a {taken[name]} and a {what}; rename one of them"
            )
        taken[name] = what


def _check_ends(graph: str, elements: Mapping[str, Element], tail: str, head: str) -> None:
    for end in (tail, head):
        if end not in elements:
            raise ModelError(
                f"{graph}: bond {tail} -> {head} is dangling, there is no element {shown(end)};"
                " define it or remove the bond"
            )
    if tail == head:
        raise ModelError(f"{graph}: bond {tail} -> {head} joins an element to itself; remove it")
    if not any(elements[end].kind in JUNCTIONS for end in (tail, head)):
        raise ModelError(
            f"{graph}: bond {tail} -> {head} has a junction at neither end;"
            " put a 0- or 1-junction between the two"
        )


def _check_domain(graph: BondGraph, bond: Bond) -> None:
    found = [graph.elements[end].domain for end in (bond.tail, bond.head)]
    named = [domain for domain in found if domain]
    for domain in named:
        if domain not in DOMAINS:
            raise ConfigurationError(
                f"{graph.name}: domain {shown(domain)} at bond {bond.tail} -> {bond.head} is "
                "unknown,"
                f" known are {', '.join(DOMAINS)}"
            )
    if not named or len(set(named)) > 1:
        raise ModelError(
            f"{graph.name}: bond {bond.tail} -> {bond.head} joins domains {found};"
            " give both junctions one domain, or put a TF or GY between them"
        )


_PORTS = {**dict.fromkeys((*SOURCES, *PASSIVE, *DETECTORS), (1, 1)), "TF": (2, 2), "GY": (2, 2)}


def _check_ports(graph: BondGraph, element: Element) -> None:
    bonds, where = graph.at(element.name), f"{graph.name}: {element.kind} {shown(element.name)}"
    least, most = _PORTS.get(element.kind, (2, 10_000))
    if not least <= len(bonds) <= most:
        wanted = f"exactly {least}" if least == most else f"at least {least}"
        raise ModelError(f"{where} has {len(bonds)} bonds, it needs {wanted}; connect it")
    if element.kind in PASSIVE and bonds[0].head != element.name:
        raise ModelError(
            f"{where} has its half-arrow pointing away; a passive element takes up power,"
            f" write {bonds[0].head} -> {element.name}"
        )
    if element.kind in TWO_PORTS and bonds[0].head == bonds[1].head:
        raise ModelError(f"{where} needs one half-arrow in (port 1) and one out (port 2)")
    wanted_junction = {"De": "0", "Df": "1"}.get(element.kind)
    if wanted_junction and graph.elements[bonds[0].other(element.name)].kind != wanted_junction:
        raise ModelError(
            f"{where} must sit on a {wanted_junction}-junction, where its variable is common"
        )


def _check_law(graph: BondGraph, element: Element) -> None:
    where = f"{graph.name}: {element.kind} {shown(element.name)}"
    law = graph.law(element)
    if law is None:
        if element.law or (element.parameters and element.kind not in DETECTORS):
            raise ConfigurationError(
                f"{where} has unknown law {shown(element.law)}, known are {', '.join(LAWS)}"
            )
        if element.kind in (*SOURCES, *DETECTORS) and not element.signal:
            raise ConfigurationError(f"{where} has no signal; name the input or channel it is")
        return
    if law.kind != element.kind and not (law.kind == "M" and element.kind in SOURCES):
        raise ConfigurationError(
            f"{where} cannot have law {shown(element.law)}, that is for {law.kind}"
        )
    if set(law.roles) != set(element.parameters):
        raise ConfigurationError(
            f"{where} has parameters {sorted(element.parameters)},"
            f" its law needs {sorted(law.roles)}; name each once"
        )
    by = graph.elements.get(element.modulated_by)
    if law.modulated != bool(by and by.kind in JUNCTIONS) or (element.modulated_by and by is None):
        raise ConfigurationError(
            f"{where} has modulated_by {element.modulated_by!r}, its law"
            f" needs {'a junction' if law.modulated else 'none'} there"
        )
    for role, parameter in element.parameters.items():
        _check_parameter(graph, element, law, role, parameter)
    _check_source_law(graph, element, where)


def _check_source_law(graph: BondGraph, element: Element, where: str) -> None:
    if element.law == "gain" and not element.signal:
        raise ConfigurationError(f"{where} has no signal; name the input that it amplifies")
    if element.law != "dissipation":
        return
    for name in element.powers or ("",):
        if name not in graph.elements or graph.elements[name].kind != "R":
            raise ConfigurationError(
                f"{where} carries the power of {shown(name)}, which is no R element; name R "
                "elements"
            )


def _check_parameter(graph: BondGraph, element: Element, law: Law, role: str, name: str) -> None:
    where = f"{graph.name}: {element.kind} {shown(element.name)}, {role} {shown(name)}"
    parameter = graph.parameters.get(name)
    if parameter is None:
        raise ConfigurationError(f"{where} is not among the parameters; give it a value and a unit")
    wanted = law.roles[role].dimension(ports(graph, element))
    if dimension(parameter.unit) != wanted:
        raise ConfigurationError(
            f"{where} has unit {shown(parameter.unit)}, it must be of {spelled(wanted)};"
            " convert the value and its unit"
        )
    if not math.isfinite(parameter.value) or not law.roles[role].admits(parameter.value):
        raise ConfigurationError(
            f"{where} = {shown(parameter.value)} {parameter.unit} must be finite and"
            f" {law.roles[role].bound}; correct its value"
        )


def ports(graph: BondGraph, element: Element) -> Ports:
    """Dimensions of effort and flow at the ports of an element."""
    found = [
        dimension(unit) for bond in graph.at(element.name) for unit in DOMAINS[graph.domain(bond)]
    ]
    made = Ports(*found[:4])
    by = graph.elements.get(element.modulated_by)
    if by is None or by.domain not in DOMAINS:
        return made
    return replace(made, by=dimension(DOMAINS[by.domain][0 if by.kind == "0" else 1]))
