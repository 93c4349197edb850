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

"""Sequential causality assignment (SCAP), reported step by step in words.

Sources first, then stores in integral causality, then resistors, then the remaining bonds.
The consequences of each choice are propagated before the next. At a 0-junction exactly one
bond sets the effort, at a 1-junction exactly one bond sets the flow; a TF passes the effort
through, a GY receives effort at both ports or sets it at both (Karnopp et al. 2000).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

from flea_diag.core.bond_graph.bond_graph import STORES, Bond, BondGraph, Element
from flea_diag.errors import ModelError, shown

Ends = dict[str, str]
"""Bond name -> node that sets the effort on it; the node at the other end sets the flow."""


@dataclass(frozen=True)
class Conflict:
    """Contradictory causality at the bonds of one node."""

    node: str
    words: str


@dataclass(frozen=True)
class Causality:
    """Outcome of SCAP.

    ``effort_from`` maps each bond to the node that sets its effort. ``derivative`` names the
    stores without integral causality (dependent states), ``arbitrary`` the elements whose
    causality was a free choice (each free choice indicates an algebraic loop), ``loops`` the
    algebraic loops found in the equations.
    """

    effort_from: Mapping[str, str]
    steps: tuple[str, ...]
    conflicts: tuple[Conflict, ...] = ()
    derivative: tuple[str, ...] = ()
    arbitrary: tuple[str, ...] = ()
    loops: tuple[tuple[str, ...], ...] = ()

    @property
    def sound(self) -> bool:
        """Every store integral, no conflict, no algebraic loop."""
        return not (self.conflicts or self.derivative or self.loops)

    def report(self) -> str:
        """The assignment in words, one line per step, followed by its defects."""
        lines = [f"{k}. {step}" for k, step in enumerate(self.steps, 1)]
        lines += [f"conflict at {c.node}: {c.words}" for c in self.conflicts]
        lines += [f"derivative causality: {name} is a dependent state" for name in self.derivative]
        lines += [f"algebraic loop: {' -> '.join((*loop, loop[0]))}" for loop in self.loops]
        if self.sound:
            lines.append("All stores have integral causality; no conflict, no algebraic loop.")
        return "\n".join(lines)


def assign_causality(graph: BondGraph) -> Causality:
    """Run SCAP; never raises, defects are in the result (``require_sound`` raises)."""
    scap = _Assignment(graph)
    for element in graph.elements.values():
        choice = _FIXED.get(element.kind)
        if choice:
            scap.choose(element, choice, f"{element.kind} {element.name}")
    for element in graph.of_kind(*STORES):
        scap.store(element)
    for element in sorted(graph.of_kind("R"), key=lambda e: _invertible(graph, e)):
        scap.resistor(element)
    for bond in graph.bonds:
        if bond.name not in scap.ends:
            scap.free_bond(bond)
    return scap.outcome()


def require_sound(graph: BondGraph, causality: Causality) -> None:
    """Raise ModelError for the first defect, naming the element and the remedy."""
    if causality.conflicts:
        first = causality.conflicts[0]
        raise ModelError(f"{graph.name}: causal conflict at {shown(first.node)}, {first.words}")
    if causality.derivative:
        name = causality.derivative[0]
        raise ModelError(
            f"{graph.name}: {graph.elements[name].kind} {shown(name)} has derivative causality,"
            " its state depends on others; merge it with the store that fixes it,"
            " or put a compliance (C with R) between the two"
        )
    if causality.loops:
        loop = causality.loops[0]
        raise ModelError(
            f"{graph.name}: algebraic loop {' -> '.join((*loop, loop[0]))};"
            " put a store (a small I or C) into it, or merge the resistors"
        )


def _invertible(graph: BondGraph, element: Element) -> bool:
    law = graph.law(element)
    return law is not None and law.flow is not None


_FIXED = {
    "Se": "effort",
    "MSe": "effort",
    "Sf": "flow",
    "MSf": "flow",
    "De": "flow",
    "Df": "effort",
}
"""What an element sets on its bond. Ideal detectors take no power: De sets flow 0, Df effort 0."""

_INTEGRAL = {"I": "flow", "C": "effort"}
_VERB = {"effort": "sets the effort", "flow": "sets the flow"}


class _Assignment:
    """Working state of one run: the causality and the report so far."""

    def __init__(self, graph: BondGraph) -> None:
        self.graph = graph
        self.ends: Ends = {}
        self.steps: list[str] = []
        self.conflicts: dict[str, Conflict] = {}
        self.derivative: list[str] = []
        self.arbitrary: list[str] = []

    def choose(self, element: Element, sets: str, who: str) -> None:
        """Let a one-port element set effort or flow on its bond, then propagate."""
        bond = self.graph.at(element.name)[0]
        far = bond.other(element.name)
        wanted = element.name if sets == "effort" else far
        if self.ends.get(bond.name, wanted) != wanted:
            self._conflict(
                element.name,
                f"it {_VERB[sets]} but {shown(far)} has already done so; another source or"
                " store fixes the same variable, remove one or join them through an element",
            )
            return
        self._set(bond, wanted, f"{who} {_VERB[sets]} on {bond.name}")

    def store(self, element: Element) -> None:
        """Prefer integral causality; record derivative causality when it is forced."""
        bond, sets = self.graph.at(element.name)[0], _INTEGRAL[element.kind]
        integral = element.name if sets == "effort" else bond.other(element.name)
        if self.ends.get(bond.name, integral) == integral:
            self.choose(element, sets, f"{element.kind} {element.name} (integral)")
            return
        self.derivative.append(element.name)
        self.steps.append(f"{element.kind} {element.name} is left with derivative causality")

    def resistor(self, element: Element) -> None:
        """Keep the propagated causality; otherwise choose freely, which indicates a loop."""
        bond = self.graph.at(element.name)[0]
        if bond.name not in self.ends:
            self.arbitrary.append(element.name)
            self.choose(element, "effort", f"R {element.name} (free choice)")
        elif self.ends[bond.name] != element.name and not _invertible(self.graph, element):
            self._conflict(
                element.name,
                "its law gives an effort for a flow and cannot be inverted, but the effort is"
                " imposed on it; put a compliance between it and what sets the effort",
            )

    def free_bond(self, bond: Bond) -> None:
        """Choose the causality of an undetermined bond between junctions, and report it."""
        if bond.name in self.ends:
            return
        self.arbitrary.append(bond.name)
        self._set(bond, bond.tail, f"bond {bond.name} (free choice): {bond.tail} sets the effort")

    def outcome(self) -> Causality:
        """Freeze the run."""
        for element in self.graph.of_kind("0", "1"):
            self._check_junction(element)
        return Causality(
            dict(self.ends),
            tuple(self.steps),
            tuple(self.conflicts.values()),
            tuple(self.derivative),
            tuple(self.arbitrary),
        )

    def _set(self, bond: Bond, end: str, words: str) -> None:
        before = set(self.ends)
        self.ends[bond.name] = end
        pending = [bond.tail, bond.head]
        while pending:
            node = pending.pop()
            for follower, source in self._follow(node).items():
                if follower not in self.ends:
                    self.ends[follower] = source
                    other = next(b for b in self.graph.bonds if b.name == follower)
                    pending += [other.tail, other.head]
        followed = [name for name in self.ends if name not in before and name != bond.name]
        self.steps.append(words + (f"; so follow {', '.join(followed)}" if followed else ""))

    def _follow(self, node: str) -> Ends:
        rule = _RULES.get(self.graph.elements[node].kind)
        return rule(node, self.graph.at(node), self.ends) if rule else {}

    def _check_junction(self, element: Element) -> None:
        strong = strong_bonds(element.kind, element.name, self.graph.at(element.name), self.ends)
        if len(strong) != 1:
            what = "effort" if element.kind == "0" else "flow"
            names = ", ".join(bond.name for bond in strong) or "none"
            self._conflict(
                element.name,
                f"a {element.kind}-junction takes its {what} from exactly one bond, here {names};"
                " remove a source, or put an element between the two that set it",
            )

    def _conflict(self, node: str, words: str) -> None:
        self.conflicts.setdefault(node, Conflict(node, words))


def strong_bonds(
    kind: str, node: str, bonds: tuple[Bond, ...], ends: Mapping[str, str]
) -> tuple[Bond, ...]:
    """Bonds that set the common variable of a junction; exactly one if causality is sound."""
    brings_effort = kind == "0"
    return tuple(b for b in bonds if b.name in ends and (ends[b.name] != node) == brings_effort)


def _junction(kind: str) -> Callable[[str, tuple[Bond, ...], Ends], Ends]:
    def rule(node: str, bonds: tuple[Bond, ...], ends: Ends) -> Ends:
        strong = strong_bonds(kind, node, bonds, ends)
        open_bonds = [bond for bond in bonds if bond.name not in ends]
        weak = {b.name: node if kind == "0" else b.other(node) for b in open_bonds}
        if strong:
            return weak
        if len(open_bonds) == 1:
            (last,) = open_bonds
            return {last.name: last.other(node) if kind == "0" else node}
        return {}

    return rule


def _two_port(through: bool) -> Callable[[str, tuple[Bond, ...], Ends], Ends]:
    def rule(node: str, bonds: tuple[Bond, ...], ends: Ends) -> Ends:
        result = {}
        for near, far in (bonds, bonds[::-1]):
            if near.name in ends:
                node_sets_near = ends[near.name] == node
                node_sets_far = node_sets_near != through
                result[far.name] = node if node_sets_far else far.other(node)
        return result

    return rule


_RULES: dict[str, Callable[[str, tuple[Bond, ...], Ends], Ends]] = {
    "0": _junction("0"),
    "1": _junction("1"),
    "TF": _two_port(through=True),
    "GY": _two_port(through=False),
}


def with_loops(causality: Causality, loops: tuple[tuple[str, ...], ...]) -> Causality:
    """The same assignment with the algebraic loops found in its equations."""
    return replace(causality, loops=loops)
