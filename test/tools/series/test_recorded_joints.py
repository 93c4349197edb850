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

"""Which joint of an arm a recording is looked at for."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from flea_diag.errors import RecordingError
from flea_diag.tools.series.recorded_joints import RecordedJoints
from flea_diag.tools.series.recorded_series import RecordedSeries, Series

STATE = "sensor_msgs/msg/JointState"
MOVING, STILL = np.arange(20.0), np.zeros(20)


def series(topic: str, field: str, kind: str = STATE, moves: bool = True) -> Series:
    place = {"topic": topic, "type": kind, "field": field}
    return Series(place, np.arange(20.0), MOVING if moves else STILL)


def arm(*more: Series) -> RecordedSeries:
    joints = ("joint_1", "joint_10", "joint_2")
    states = [series("/states", f"{f}[{j}]") for j in joints for f in ("position", "effort")]
    still = series("/states", "position[wrist]", moves=False)
    return RecordedSeries(Path("run"), False, (*states, still, *more))


WARM = series("/joint_2/temperature", "temperature", "sensor_msgs/msg/Temperature")
WARM_10 = series("/joint_10/temperature", "temperature", "sensor_msgs/msg/Temperature")


def test_it_is_the_joint_of_which_most_is_recorded() -> None:
    assert RecordedJoints.of(arm()).chosen == "joint_1"
    assert RecordedJoints.of(arm(WARM)).chosen == "joint_2"


def test_what_is_of_another_joint_is_left_out_by_element_and_by_topic() -> None:
    joints = RecordedJoints.of(arm(WARM, WARM_10), "joint_10")
    other = series("/load_cell", "data", "std_msgs/msg/Float64")
    found = [joints.is_of_another(each) for each in (WARM, WARM_10, other)]
    assert found == [True, False, False]
    assert joints.is_of_another(series("/states", "effort[joint_1]"))
    assert not joints.is_of_another(series("/states", "effort[joint_10]"))


def test_channels_in_a_joint_state_are_no_joints_and_a_joint_at_rest_is_refused() -> None:
    channels = tuple(series("/slow", f"position[{name}]") for name in ("current", "speed"))
    assert RecordedJoints.of(RecordedSeries(Path("run"), False, channels)).chosen == ""
    with pytest.raises(RecordingError, match="run: no joint 'wrist' moves; joints that move are j"):
        RecordedJoints.of(arm(), "wrist")
