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

"""Which relations the reaction of a stop enters follows from the graph."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from support.places import WING

from flea_diag.configuration.description import compiled_relations, described
from flea_diag.core.residuals.stop import Stop, stop_of

FLEA = compiled_relations("actuator.yaml").residuals


def test_the_balance_of_forces_holds_the_reaction_and_nothing_else_does() -> None:
    """K i - m a - F - friction - R = 0: one newton of the stop moves the residual by one."""
    stop = compiled_relations("actuator.yaml").stop
    assert dict(stop.reactions) == {"parity_mechanical": pytest.approx(-1.0)}
    assert stop.channels == ("actuator_position", "load_position")
    assert (stop.low_m, stop.high_m, stop.within_m) == (0.0, 0.1, 0.002)


def test_the_reaction_is_seen_through_a_gear_and_a_screw() -> None:
    """The other actuator: its balance is at the screw's shaft, divided by the screw's ratio."""
    stop = compiled_relations(WING).stop
    assert dict(stop.reactions) == {"parity_mechanical": pytest.approx(-1.0)}
    assert stop.channels == ("actuator_position",)


def test_a_balance_needs_the_only_reading_of_where_the_part_is() -> None:
    assert compiled_relations(WING).stop.needed == {"actuator_position": {"parity_mechanical"}}
    assert compiled_relations("actuator.yaml").stop.needed == {}


def test_a_stop_beyond_the_load_cell_enters_no_relation() -> None:
    model = described("actuator.yaml")
    assert model.travel is not None
    beyond = replace(model, travel=replace(model.travel, at="load_side"))
    stop = stop_of(beyond, [name for name in FLEA.relations if name in model.residuals])
    assert dict(stop.reactions) == {}
    assert stop.channels == ("load_position",)


def test_ends_that_are_not_stated_come_from_the_range_of_a_position_channel() -> None:
    stop = Stop(channels=("actuator_position", "load_position"))
    assert not stop.known
    assert not stop.within({"actuator_position": (-math.inf, 0.1)}).known
    found = stop.within({"load_position": (0.0, 0.05), "motor_current": (-20.0, 20.0)})
    assert found.known
    assert (found.low_m, found.high_m, found.within_m) == (0.0, 0.05, pytest.approx(0.001))
    wide = {"actuator_position": (-0.02, 0.12), "load_position": (0.0, 0.1)}
    assert stop.within(wide).high_m == 0.1


def test_stated_ends_are_kept() -> None:
    stop = Stop(0.0, 0.1, 0.002, ("load_position",))
    assert stop.within({"load_position": (0.0, 0.05)}) is stop


def test_what_is_within_an_end_is_near_it_and_nothing_where_none_is_stated() -> None:
    at_an_end = Stop(0.0, 0.1, 0.002).near(np.array([-0.001, 0.0019, 0.0981]))
    assert at_an_end.all()
    assert not Stop(0.0, 0.1, 0.002).near(np.array([0.0021, 0.05, 0.0979, math.nan])).any()
    places = np.array([0.0, 0.05])
    assert not Stop().near(places).any()


def test_without_a_sensor_of_the_displacement_there_is_no_end_to_see() -> None:
    model = described("actuator.yaml").with_sensors(["motor_current", "motor_voltage"])
    assert stop_of(model, ()) == Stop(0.0, 0.1, 0.002)
    assert not stop_of(model, ()).known
