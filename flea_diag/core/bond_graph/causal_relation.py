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

"""Causal relations: one assignment for every variable of the graph, from the causal strokes.

``target = expression`` when instantaneous, ``d target/dt = expression`` when temporal. The
state equations, the temporal causal graph and the model with measured inputs are all derived
from this one list, so they cannot disagree.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace

from flea_diag.core.bond_graph.bond_graph import Bond, BondGraph, Element
from flea_diag.core.bond_graph.causality import (
    Causality,
    assign_causality,
    strong_bonds,
    with_loops,
)
from flea_diag.core.symbolic.expression import (
    ZERO,
    Expression,
    Variable,
    product,
    symbols,
    total,
)
from flea_diag.errors import ModelError, shown


@dataclass(frozen=True)
class Relation:
    """Assignment of one variable, and the element it comes from."""

    target: str
    expression: Expression
    element: str
    temporal: bool = False


def flow_of(graph: BondGraph, bond: Bond) -> str:
    """Name of the flow variable of a bond; that of an I is its state."""
    return _own_state(graph, bond, "I") or bond.flow


def effort_of(graph: BondGraph, bond: Bond) -> str:
    """Name of the effort variable of a bond; that of a C with a capacity is its state."""
    return _own_state(graph, bond, "C") or bond.effort


def _own_state(graph: BondGraph, bond: Bond, kind: str) -> str:
    element = graph.elements[bond.head]
    law = graph.law(element)
    displaced = law is not None and law.effort is not None
    return element.state if element.kind == kind and not displaced else ""


def solve(graph: BondGraph) -> tuple[Causality, tuple[Relation, ...]]:
    """SCAP, relations and algebraic loops of a graph.

    Relations are empty if SCAP found a conflict or derivative causality.
    """
    causality = assign_causality(graph)
    if not causality.sound:
        return causality, ()
    relations = causal_relations(graph, causality)
    return with_loops(causality, algebraic_loops(relations)), relations


def causal_relations(graph: BondGraph, causality: Causality) -> tuple[Relation, ...]:
    """One relation for each effort, flow, state and channel of a graph with sound causality."""
    relations: list[Relation] = []
    for element in graph.elements.values():
        relations += _BUILD[element.kind](graph, element, causality.effort_from)
    return tuple(relations)


def common_of(graph: BondGraph, junction: Element, ends: Mapping[str, str]) -> str:
    """Name of the common variable of a junction: effort of a 0-junction, flow of a 1-junction."""
    (strong,) = strong_bonds(junction.kind, junction.name, graph.at(junction.name), ends)
    return (effort_of if junction.kind == "0" else flow_of)(graph, strong)


def _symbols(graph: BondGraph, bond: Bond) -> tuple[Variable, Variable]:
    return Variable(effort_of(graph, bond)), Variable(flow_of(graph, bond))


def _parameters(element: Element) -> dict[str, Expression]:
    return {role: Variable(name) for role, name in element.parameters.items()}


def _junction(graph: BondGraph, element: Element, ends: Mapping[str, str]) -> list[Relation]:
    node, zero = element.name, element.kind == "0"
    bonds = graph.at(node)
    (strong,) = strong_bonds(element.kind, node, bonds, ends)
    common, summed = (effort_of, flow_of) if zero else (flow_of, effort_of)
    others = [bond for bond in bonds if bond is not strong]
    lead = Variable(common(graph, strong))
    relations = [Relation(common(graph, bond), lead, node) for bond in others]
    # Power in equals power out: a bond that points the same way as the strong bond has the
    # opposite sign, the others have the same sign. Detectors take no power.
    balance = total(
        (-1 if (bond.head == node) == (strong.head == node) else 1) * Variable(summed(graph, bond))
        for bond in others
        if graph.elements[bond.other(node)].kind not in ("De", "Df")
    )
    return [*relations, Relation(summed(graph, strong), balance, node)]


def _source(graph: BondGraph, element: Element, ends: Mapping[str, str]) -> list[Relation]:
    (bond,) = graph.at(element.name)
    name = effort_of if element.kind in ("Se", "MSe") else flow_of
    return [Relation(name(graph, bond), _source_value(graph, element), element.name)]


def _source_value(graph: BondGraph, element: Element) -> Expression:
    p = _parameters(element)
    if element.law == "dissipation":
        heats = [product(_symbols(graph, graph.at(name)[0])) for name in element.powers]
        return p["share"] * total(heats)
    return p["level"] if element.law == "constant_effort" else _of_signal(element, p)


def _of_signal(element: Element, p: Mapping[str, Expression]) -> Expression:
    signal = Variable(element.signal)
    return p["gain"] * signal if element.law == "gain" else signal


def _inertia(graph: BondGraph, element: Element, ends: Mapping[str, str]) -> list[Relation]:
    effort, flow = _symbols(graph, graph.at(element.name)[0])
    rate = effort / _parameters(element)["inertia"]
    return [Relation(flow.name, rate, element.name, temporal=True)]


def _capacity(graph: BondGraph, element: Element, ends: Mapping[str, str]) -> list[Relation]:
    effort, flow = _symbols(graph, graph.at(element.name)[0])
    p = _parameters(element)
    if "capacity" in p:
        return [Relation(effort.name, flow / p["capacity"], element.name, temporal=True)]
    law = graph.law(element)
    assert law is not None
    assert law.effort is not None
    displacement = Variable(element.state or f"q_{element.name}")
    return [
        Relation(displacement.name, flow, element.name, temporal=True),
        Relation(effort.name, law.effort(displacement, p), element.name),
    ]


def _resistor(graph: BondGraph, element: Element, ends: Mapping[str, str]) -> list[Relation]:
    (bond,) = graph.at(element.name)
    effort, flow = _symbols(graph, bond)
    law, p = graph.law(element), _parameters(element)
    assert law is not None
    assert law.effort is not None
    if law.modulated:
        p["by"] = Variable(common_of(graph, graph.elements[element.modulated_by], ends))
    if ends[bond.name] == element.name:
        return [Relation(effort.name, law.effort(flow, p), element.name)]
    if law.flow is None:
        raise ModelError(f"{graph.name}: law of R {shown(element.name)} cannot take an effort")
    return [Relation(flow.name, law.flow(effort, p), element.name)]


def _transformer(graph: BondGraph, element: Element, ends: Mapping[str, str]) -> list[Relation]:
    one, _ = graph.at(element.name)
    f1 = _symbols(graph, one)[1]
    n, law = _parameters(element).get("ratio"), graph.law(element)
    turned: list[Relation] = []
    if law is not None and law.ratio is not None:
        state = element.state or f"q_{element.name}"
        turned = [Relation(state, f1, element.name, temporal=True)]
        n = law.ratio(Variable(state), _parameters(element))
    assert n is not None
    return [*turned, *_transformed(graph, element, ends, n)]


def _transformed(
    graph: BondGraph, element: Element, ends: Mapping[str, str], n: Expression
) -> list[Relation]:
    """e1 = n e2, f2 = n f1, by the causality of port 1."""
    one, two = graph.at(element.name)
    (e1, f1), (e2, f2) = _symbols(graph, one), _symbols(graph, two)
    if ends[one.name] == element.name:
        return [Relation(e1.name, n * e2, element.name), Relation(f2.name, n * f1, element.name)]
    return [Relation(e2.name, e1 / n, element.name), Relation(f1.name, f2 / n, element.name)]


def _gyrator(graph: BondGraph, element: Element, ends: Mapping[str, str]) -> list[Relation]:
    one, two = graph.at(element.name)
    (e1, f1), (e2, f2) = _symbols(graph, one), _symbols(graph, two)
    p = _parameters(element)
    r1, r2 = p.get("back_emf") or p["modulus"], p.get("torque") or p["modulus"]
    if ends[one.name] == element.name:
        return [Relation(e1.name, r1 * f2, element.name), Relation(e2.name, r2 * f1, element.name)]
    return [Relation(f2.name, e1 / r1, element.name), Relation(f1.name, e2 / r2, element.name)]


def _detector(graph: BondGraph, element: Element, ends: Mapping[str, str]) -> list[Relation]:
    (bond,) = graph.at(element.name)
    effort, flow = _symbols(graph, bond)
    seen = effort if element.kind == "De" else flow
    offset = _parameters(element).get("offset", ZERO)
    if not element.integrates:
        return [Relation(element.signal, seen + offset, element.name)]
    state = element.state or f"x_{element.name}"
    return [
        Relation(state, seen, element.name, temporal=True),
        Relation(element.signal, Variable(state) + offset, element.name),
    ]


_BUILD = {
    **dict.fromkeys(("0", "1"), _junction),
    **dict.fromkeys(("Se", "Sf", "MSe", "MSf"), _source),
    "I": _inertia,
    "C": _capacity,
    "R": _resistor,
    "TF": _transformer,
    "GY": _gyrator,
    **dict.fromkeys(("De", "Df"), _detector),
}


def algebraic_loops(relations: Iterable[Relation]) -> tuple[tuple[str, ...], ...]:
    """Loops of instantaneous relations, each as its variables in order."""
    return _order(relations)[1]


def in_order(relations: Iterable[Relation]) -> tuple[Relation, ...]:
    """Instantaneous relations in order of evaluation: each uses only earlier results."""
    return _order(relations)[0]


def _order(
    relations: Iterable[Relation],
) -> tuple[tuple[Relation, ...], tuple[tuple[str, ...], ...]]:
    instant = {r.target: r for r in relations if not r.temporal}
    done: dict[str, Relation] = {}
    loops: list[tuple[str, ...]] = []

    def visit(target: str, path: tuple[str, ...]) -> None:
        if target in path:
            loops.append(path[path.index(target) :])
        elif target in instant and target not in done:
            for name in symbols(instant[target].expression):
                visit(name, (*path, target))
            done[target] = instant[target]

    for target in instant:
        visit(target, ())
    return tuple(done.values()), tuple(loops)


def with_measured(
    relations: Iterable[Relation], measured: Mapping[str, tuple[str, Expression]]
) -> tuple[Relation, ...]:
    """The same relations with some variables replaced by their measurement.

    Parameters
    ----------
    measured
        Channel -> variable that it measures, and that variable by the reading. The relation
        that assigned the variable is dropped; the channel becomes an input, which cuts any loop
        through the variable.
    """
    read = dict(measured.values())
    kept = [r for r in relations if r.target not in measured]
    return tuple(
        replace(r, expression=read[r.target], temporal=False) if r.target in read else r
        for r in kept
    )
