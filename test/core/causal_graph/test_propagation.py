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

"""Temporal causal graph and backward propagation, against what is worked out by hand."""

from __future__ import annotations

import pytest

from flea_diag.configuration.files import load_yaml
from flea_diag.core.bond_graph.actuator import Actuator, actuator
from flea_diag.core.causal_graph.operating_point import QUADRANTS, operating_values
from flea_diag.core.causal_graph.propagation import (
    InitialDeviation,
    combined,
    propagate_backward,
    propagate_forward,
    scaled,
)
from flea_diag.core.causal_graph.temporal_causal_graph import (
    TemporalCausalGraph,
    temporal_causal_graph,
)
from flea_diag.core.drawing.picture import causal_graph_dot


@pytest.fixture(scope="module")
def flea() -> Actuator:
    return actuator(load_yaml("actuator.yaml"))


@pytest.fixture(scope="module")
def graph(flea: Actuator) -> TemporalCausalGraph:
    return temporal_causal_graph(flea.relations("stand"), flea.graph.parameters)


def label(flea: Actuator, graph: TemporalCausalGraph, source: str, target: str) -> str:
    (edge,) = (
        e
        for e in (*graph.edges, *graph.parameter_edges)
        if (e.source, e.target) == (source, target)
    )
    return edge.label(flea.graph.tokens())


@pytest.mark.parametrize(
    ("source", "target", "expected"),
    [
        ("e_winding", "e_inductance", "-1"),
        ("e_inductance", "i", "dt/L"),
        ("i", "f_winding", "="),
        ("f_winding", "e_winding", "R*(1 + alpha*(T_w - T_0))"),
        ("f_motor_1", "e_motor_2", "Kt"),
        ("f_motor_2", "e_motor_1", "Km"),
        ("e_rotor", "omega", "dt/J"),
        ("f_screw_1", "f_screw_2", "rho"),
        ("e_screw_2", "e_screw_1", "rho"),
        ("e_load_inertia", "v_load", "dt/M_l"),
        ("f_compliance", "stretch", "dt"),
        ("stretch", "e_compliance", "K_l"),
        ("winding_resistance", "e_winding", "(1 + alpha*(T_w - T_0))*f_winding"),
        ("back_emf_constant", "e_motor_1", "f_motor_2"),
    ],
)
def test_edge_labels(
    flea: Actuator, graph: TemporalCausalGraph, source: str, target: str, expected: str
) -> None:
    assert label(flea, graph, source, target) == expected


def test_heat_of_the_winding_follows_the_sign_of_the_current(
    flea: Actuator, graph: TemporalCausalGraph
) -> None:
    (edge,) = (e for e in graph.edges if (e.source, e.target) == ("f_winding", "f_winding_heat"))
    signs = [edge.sign(operating_values(flea, quadrant)) for quadrant in QUADRANTS]
    assert signs == [quadrant.current for quadrant in QUADRANTS]


def test_low_speed_is_explained_as_worked_out_by_hand(
    flea: Actuator, graph: TemporalCausalGraph
) -> None:
    values = operating_values(flea, QUADRANTS[0])
    found = {str(s.hypothesis) for s in propagate_backward(graph, "motor_speed", "-", values)}
    expected = {
        "motor_speed_sensor-",
        "rotor_inertia+",
        "screw_coulomb_friction+",
        "screw_viscous_friction+",
        "torque_constant-",
        "winding_inductance+",
        "winding_resistance+",
        "load_mass+",
        "load_friction+",
        "commanded_load+",
        "drive_gain-",
    }
    assert expected <= found
    assert not {"torque_constant+", "winding_resistance-", "drive_gain+"} & found
    # Nothing thermal acts back on the motion.
    assert not {h for h in found if "capacity" in h or "ambient" in h or "heat" in h}


def test_complete_search_also_suspects_by_slower_paths(
    flea: Actuator, graph: TemporalCausalGraph
) -> None:
    values = operating_values(flea, QUADRANTS[0])
    first = propagate_backward(graph, "motor_speed", "-", values)
    every = propagate_backward(graph, "motor_speed", "-", values, complete=True)
    assert {s.hypothesis for s in first} < {s.hypothesis for s in every}
    slow = next(s for s in every if str(s.hypothesis) == "back_emf_constant-")
    fast = next(s for s in every if str(s.hypothesis) == "back_emf_constant+")
    assert fast.order < slow.order


def test_every_suspicion_does_move_the_measurement(
    flea: Actuator, graph: TemporalCausalGraph
) -> None:
    """Forward propagation of each hypothesis reaches what it was suspected for."""
    values = operating_values(flea, QUADRANTS[0])
    for suspicion in propagate_backward(graph, "motor_temperature", "+", values):
        cause = suspicion.hypothesis
        if cause.mode or cause.name in graph.inputs:
            continue
        entering = [
            InitialDeviation(e.target, int(e.temporal), "+", cause.name)
            for e in graph.of_parameter[cause.name]
        ]
        assert propagate_forward(graph, entering, values)["motor_temperature"].order >= 0


def test_sign_of_hypotheses_turns_with_the_quadrant(
    flea: Actuator, graph: TemporalCausalGraph
) -> None:
    for quadrant in QUADRANTS:
        values = operating_values(flea, quadrant)
        found = {str(s.hypothesis) for s in propagate_backward(graph, "motor_speed", "-", values)}
        assert f"screw_coulomb_friction{'+' if quadrant.speed > 0 else '-'}" in found
        assert f"winding_resistance{'+' if quadrant.current > 0 else '-'}" in found


def test_algebra_of_signs() -> None:
    assert combined("++0") == "+"
    assert combined("+-") == "*"
    assert combined("0*") == "*"
    assert combined("") == "0"
    assert [scaled(s, -1) for s in "+-0*"] == ["-", "+", "0", "*"]
    assert scaled("*", 0) == "0"


def test_picture_has_every_edge_once(flea: Actuator, graph: TemporalCausalGraph) -> None:
    dot = causal_graph_dot(graph, frozenset(flea.sensors), flea.graph.tokens())
    assert dot.count(" -> ") == len(graph.edges) + len(graph.parameter_edges)
    assert '"e_inductance" -> "i" [label="dt/L" style=dashed];' in dot
