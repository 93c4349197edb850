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

"""What names say of a series, and what series say whose names say nothing."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from support.foreign.recordings_of_others import Sent, csv
from support.places import DATA

from flea_diag.tools.series.reading_grid import reading_grid
from flea_diag.tools.series.series_reader import recorded_series
from flea_diag.tools.series.series_words import words_of
from flea_diag.tools.stand_folder.proposal import proposal

JOINT_STATE = "sensor_msgs/msg/JointState"
SAID = {
    ("set_point_mm", ""): ("position", "commanded", "mm"),
    ("Motor Speed [rpm]", ""): ("speed", "motor", "rpm"),
    ("nutTempF", ""): ("temperature", "nut", "degF"),
    ("load_kgf", ""): ("force", "load", "kgf"),
    ("load_torque_nm", ""): ("torque", "load", "N*m"),
    ("voltage setpoint", ""): ("voltage", "commanded", ""),
    ("U_mot_V", ""): ("voltage", "motor", "V"),
    ("x", ""): ("position", "", ""),
    ("q7", ""): ("position", "", ""),
    ("/joint_states/effort[elbow]", JOINT_STATE): ("effort", "", ""),
    ("/sensors/slow/position[motor_current]", JOINT_STATE): ("current", "motor", ""),
    ("/parts/status[nut].values[kelvin].value", "x/msg/Y"): ("temperature", "nut", "K"),
    ("/motor/temperature/temperature", "sensor_msgs/msg/Temperature"): (
        "temperature", "motor", "",
    ),
}  # fmt: skip


@pytest.mark.parametrize(("name", "message"), SAID)
def test_words_of_names(name: str, message: str) -> None:
    found = words_of(name, message)
    said = (found.quantity, " ".join(sorted(found.qualifiers)), found.unit)
    assert said == SAID[name, message]


def test_a_message_says_its_unit_where_the_field_is_what_it_is_defined_to_be() -> None:
    assert words_of("/joint_states/velocity[elbow]", JOINT_STATE).typed == "rad/s"
    assert words_of("/sensors/slow/position[motor_current]", JOINT_STATE).typed == ""


def test_series_without_names_are_told_by_which_follows_which(tmp_path: Path) -> None:
    """All but which of two equal positions is which, and whose a second temperature is."""
    sent = (
        Sent("load_force", "v0", "lbf"),
        Sent("motor_voltage", "v1", sign=-1),
        Sent("ambient_temperature", "v2", "degF"),
        Sent("motor_speed", "v3", "rpm", sign=-1),
        Sent("actuator_position", "v4", "mm"),
        Sent("motor_temperature", "v5"),
        Sent("motor_current", "v6", "mA", sign=-1),
    )
    found = proposal(reading_grid(recorded_series(csv(tmp_path / "run.csv", sent))))
    guessed = {each.source.name: (each.channel, each.sign) for each in found.channels}
    assert guessed == {each.name: (each.channel, int(each.sign)) for each in sent}
    units = {each.source.name: each.unit for each in found.channels}
    assert (units["v3"], units["v4"], units["v6"]) == ("rpm", "mm", "mA")
    assert all("source" in each.doubts for each in found.channels)


def test_the_channels_of_cranfield_are_those_that_its_stand_has() -> None:
    path = DATA / "cranfield" / "normal.csv.gz"
    if not path.is_file():
        pytest.skip(f"no recordings in {DATA}")
    found = proposal(reading_grid(recorded_series(path)))
    assert found.template.name == "stepper_screw"
    assert found.rate_hz == 25.0
    assert found.grid.times is not None
    assert found.grid.times.split_by == ("load_kgf", "test")
    assert {e.channel: (e.source.name, e.unit, e.sign) for e in found.channels} == {
        "motor_current": ("motor_current_a", "A", 1),
        "actuator_position": ("set_point_mm - position_error_mm", "mm", 1),
        "commanded_load": ("load_kgf", "kgf", -1),
    }
    assert np.isclose(found.grid.period_s, 0.04)
