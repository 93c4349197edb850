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

"""Lags of channels against a motion in closed form, with one of them late or early."""

from __future__ import annotations

import numpy as np
import pytest
from core.calibration.test_sign_check import PERIOD_S, UNITS, driven

from flea_diag.tools.recordings.channel_lag import ChannelLag, channel_lags


def lags(late: str = "", scans: int = 0) -> dict[str, ChannelLag]:
    """By the later channel of each pair."""
    columns = driven()
    if late:
        columns[late] = np.roll(columns[late], scans)
    values = np.column_stack([columns[name] for name in UNITS])[50:]
    return {each.channel: each for each in channel_lags(UNITS, values, PERIOD_S)}


def test_what_is_read_at_once_has_no_lag() -> None:
    found = lags()
    assert found.keys() == {"actuator_position", "load_force"}
    assert not any(each.is_late for each in found.values())
    assert abs(found["actuator_position"].lag_s) < 0.002


@pytest.mark.parametrize(("channel", "scans"), [("actuator_position", 5), ("load_force", 20)])
def test_a_late_channel_is_named_with_its_lag(channel: str, scans: int) -> None:
    found = lags(channel, scans)[channel]
    assert found.is_late
    assert found.lag_s == pytest.approx(scans * PERIOD_S, abs=max(3.0 * found.error_s, 0.002))
    assert found.words.startswith(f"{channel} comes ")


def test_of_an_early_channel_the_other_one_comes_late() -> None:
    assert lags("motor_speed", 4)["actuator_position"].words.startswith(
        "motor_speed comes 40 ms after actuator_position"
    )


def test_nothing_is_said_of_rest_or_without_a_position() -> None:
    noise = np.random.default_rng(1).normal(size=(2000, len(UNITS)))
    assert channel_lags(UNITS, noise, PERIOD_S) == []
    assert channel_lags({"motor_current": "A"}, noise[:, :1], PERIOD_S) == []
