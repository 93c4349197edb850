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

"""The small picture of the causal graph holds what the large graph holds."""

from __future__ import annotations

import itertools

import pytest
from support.places import WING

from flea_diag.configuration.files import load_yaml
from flea_diag.configuration.screens import load_causal_map
from flea_diag.core.bond_graph.actuator import actuator
from flea_diag.core.causal_graph.operating_point import QUADRANTS, operating_values
from flea_diag.core.causal_graph.propagation import propagate_backward
from flea_diag.core.causal_graph.temporal_causal_graph import temporal_causal_graph

FILES = ("actuator.yaml", str(WING))


@pytest.mark.parametrize("file", FILES)
def test_a_cause_has_a_path_to_a_channel_where_the_graph_has_one(file: str) -> None:
    model = actuator(load_yaml(file), file)
    graph = temporal_causal_graph(model.relations("stand"), model.graph.parameters)
    values = operating_values(model, QUADRANTS[0])
    drawn = load_causal_map(file)
    parameters = {edge.source for edge in graph.parameter_edges}
    for channel in ("motor_speed", "motor_current", "load_force"):
        found = propagate_backward(graph, channel, "-", values, complete=True)
        reached = {str(row.hypothesis).rstrip("+-") for row in found} & parameters
        assert reached
        assert all(drawn.path(cause, channel) for cause in reached)
        # What has no way to the channel in the large graph has none in the small one.
        assert not any(
            drawn.path(cause, channel) for cause in parameters - _ancestors(graph, channel)
        )


def _ancestors(graph, channel: str) -> set[str]:
    """Parameters from which any edges lead to a channel, whatever their sign."""
    seen, new = set(), {channel}
    while new:
        seen |= new
        new = {edge.source for node in new for edge in graph.into.get(node, ())} - seen
    return {edge.source for node in seen for edge in graph.parameters_into.get(node, ())}


def test_a_path_goes_along_edges_and_is_the_shortest() -> None:
    drawn = load_causal_map("actuator.yaml")
    path = drawn.path("screw_coulomb_friction", "parity_mechanical_dn")
    assert path == ("e_screw_friction", "e_rotor", "omega", "motor_speed", "parity_mechanical")
    edges = {(edge.source, edge.target) for edge in drawn.edges}
    assert set(itertools.pairwise(path[:-1])) <= edges


def test_a_sensor_fault_begins_at_its_channel() -> None:
    drawn = load_causal_map("actuator.yaml")
    assert drawn.path("motor_current_bias", "parity_mechanical") == (
        "motor_current",
        "parity_mechanical",
    )
    assert drawn.path("motor_temperature_drift", "motor_temperature") == ("motor_temperature",)


def test_what_the_map_does_not_hold_has_no_path() -> None:
    drawn = load_causal_map("actuator.yaml")
    assert drawn.path("screw_coulomb_friction", "motor_current_noise") == ()
    assert drawn.path("no_such_parameter", "parity_mechanical") == ()
