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

"""SCAP against graphs worked by hand, ladders of any length, and graphs that are wrong."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from flea_diag.core.bond_graph.bond_graph import BondGraph, Element, Parameter
from flea_diag.core.bond_graph.causal_relation import solve
from flea_diag.core.bond_graph.causality import require_sound
from flea_diag.core.bond_graph.graph_building import bond_graph
from flea_diag.core.bond_graph.state_space import state_space
from flea_diag.core.drawing.picture import bond_graph_dot
from flea_diag.errors import ModelError

OHM, FARAD, HENRY = "ohm", "F", "H"


def electrical(parts: str, arrows: str, units: dict[str, str]) -> BondGraph:
    """Graph from ``name:kind`` words and ``a>b`` words; each parameter is 1 in its unit."""
    elements, parameters = [], []
    for part in parts.split():
        name, kind = part.split(":")
        if kind in "01":
            elements.append(Element(name, kind, "electrical"))
        elif kind in ("Se", "Sf", "De", "Df"):
            elements.append(Element(name, kind, signal=f"{name}_signal"))
        else:
            law, role = {
                "R": ("", "resistance"),
                "C": ("capacity", "capacity"),
                "I": ("", "inertia"),
                "TF": ("", "ratio"),
                "GY": ("", "modulus"),
            }[kind]
            parameters.append(Parameter(f"p_{name}", 1.0, units[kind]))
            elements.append(Element(name, kind, law=law, parameters={role: f"p_{name}"}))
    pairs = [tuple(arrow.split(">")) for arrow in arrows.split()]
    return bond_graph("test", tuple(elements), tuple(pairs), tuple(parameters))


UNITS = {"R": OHM, "C": FARAD, "I": HENRY, "TF": "1", "GY": OHM}


def test_series_rlc_circuit_as_worked_by_hand() -> None:
    graph = electrical("e:Se one:1 r:R l:I c:C", "e>one one>r one>l one>c", UNITS)
    causality, relations = solve(graph)
    # The source and the capacitor set efforts; the inductor takes one and sets the flow, so
    # the resistor gets the flow and answers with an effort.
    assert causality.effort_from == {"e": "e", "l": "one", "c": "c", "r": "r"}
    assert causality.sound
    assert not causality.arbitrary
    by_target = {r.target: str(r.expression) for r in relations}
    assert by_target["e_l"] == "e_e - e_r - e_c"
    assert by_target["e_r"] == "p_r*f_r"
    assert by_target["f_l"] == "e_l/p_l"


def test_motor_as_worked_by_hand() -> None:
    graph = electrical(
        "v:Se a:1 l:I r:R g:GY s:1 j:I b:R",
        "v>a a>l a>r a>g g>s s>j s>b",
        UNITS,
    )
    causality, _ = solve(graph)
    # Both inertias set the flow of their junction, so the gyrator sets both efforts.
    assert causality.effort_from["g_1"] == "g"
    assert causality.effort_from["g_2"] == "g"
    assert causality.sound


def test_transformer_passes_the_effort_through() -> None:
    graph = electrical("v:Se a:0 t:TF b:1 l:I", "v>a a>t t>b b>l", UNITS)
    causality, relations = solve(graph)
    # The source sets the effort of port 1, so the transformer sets that of port 2.
    assert causality.effort_from["t_1"] == "a"
    assert causality.effort_from["t_2"] == "t"
    assert {r.target: str(r.expression) for r in relations}["e_t_2"] == "e_t_1/p_t"


def test_report_says_each_step_in_words() -> None:
    graph = electrical("e:Se one:1 r:R l:I c:C", "e>one one>r one>l one>c", UNITS)
    report = solve(graph)[0].report().splitlines()
    assert report[0] == "1. Se e sets the effort on e"
    assert report[1] == "2. I l (integral) sets the flow on l; so follow r, c"
    assert report[-1] == "All stores have integral causality; no conflict, no algebraic loop."


@pytest.mark.slow
@settings(deadline=None)
@given(st.integers(1, 12), st.data())
def test_ladder_is_always_integral_without_loops(steps: int, data: st.DataObject) -> None:
    """R in series, C to ground, any number: a state for each C, poles real and stable."""
    parts, arrows = ["e:Se", "s0:1"], ["e>s0"]
    for k in range(steps):
        parts += [f"r{k}:R", f"n{k}:0", f"c{k}:C"]
        arrows += [f"s{k}>r{k}", f"s{k}>n{k}", f"n{k}>c{k}"]
        if k + 1 < steps:
            parts.append(f"s{k + 1}:1")
            arrows.append(f"n{k}>s{k + 1}")
    order = data.draw(st.permutations(parts))
    graph = electrical(" ".join(order), " ".join(data.draw(st.permutations(arrows))), UNITS)
    causality, relations = solve(graph)
    assert causality.sound
    assert not causality.arbitrary
    last = f"e_c{steps - 1}"
    system = state_space(relations, [f"f_c{steps - 1}"], graph.values())
    assert len(system.states) == steps
    assert last in system.states
    linear = system.linearise(np.zeros(steps), np.zeros(1))
    poles = np.linalg.eigvals(linear.a)
    # A ladder of unit R and C is a chain with eigenvalues -2 (1 - cos((2k-1) pi/(2n+1))).
    k = np.arange(1, steps + 1)
    expected = -2 * (1 - np.cos((2 * k - 1) * np.pi / (2 * steps + 1)))
    np.testing.assert_allclose(np.sort(poles.real), np.sort(expected), atol=1e-9)
    np.testing.assert_allclose(poles.imag, 0.0, atol=1e-9)


def test_two_sources_on_one_node_are_a_conflict_that_is_named_and_drawn() -> None:
    graph = electrical("a:Se b:Se n:0 r:R", "a>n b>n n>r", UNITS)
    causality, relations = solve(graph)
    assert not causality.sound
    assert relations == ()
    assert {c.node for c in causality.conflicts} & {"b", "n"}
    with pytest.raises(ModelError, match=r"conflict at 'b'.*remove one"):
        require_sound(graph, causality)
    assert "color=red" in bond_graph_dot(graph, causality)


def test_parallel_capacitors_leave_one_with_derivative_causality() -> None:
    graph = electrical("i:Sf n:0 c:C d:C", "i>n n>c n>d", UNITS)
    causality, _ = solve(graph)
    assert causality.derivative == ("d",)
    with pytest.raises(ModelError, match=r"C 'd' has derivative causality.*merge it"):
        require_sound(graph, causality)


def test_two_resistors_in_a_divider_are_an_algebraic_loop() -> None:
    graph = electrical("e:Se s:1 r:R n:0 q:R", "e>s s>r s>n n>q", UNITS)
    causality, _ = solve(graph)
    assert causality.arbitrary
    assert causality.loops
    with pytest.raises(ModelError, match=r"algebraic loop .*put a store"):
        require_sound(graph, causality)


def test_friction_cannot_take_an_effort() -> None:
    laws = {"coulomb": "c", "viscous": "v", "smooth_flow": "w"}
    graph = bond_graph(
        "test",
        (
            Element("push", "Se", signal="push"),
            Element("node", "0", "rotation"),
            Element("rub", "R", law="friction", parameters=laws),
        ),
        (("push", "node"), ("node", "rub")),
        (
            Parameter("c", 1.0, "N*m"),
            Parameter("v", 1.0, "N*m*s/rad"),
            Parameter("w", 1.0, "rad/s"),
        ),
    )
    with pytest.raises(ModelError, match=r"'rub'.*cannot be inverted"):
        require_sound(graph, solve(graph)[0])


def test_picture_marks_the_end_that_receives_the_effort() -> None:
    graph = electrical("e:Se one:1 l:I", "e>one one>l", UNITS)
    dot = bond_graph_dot(graph, solve(graph)[0])
    assert '"one" -> "l" [dir=both arrowhead=teelnormal arrowtail=none];' in dot
    assert '"e" -> "one" [dir=both arrowhead=teelnormal arrowtail=none];' in dot
