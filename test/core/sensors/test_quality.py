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

from __future__ import annotations

import math

import pytest
from support.observed import FLEA_COUNTS

from flea_diag.core.sensors.quality import ABSENT_S, SATURATED_S, ChannelMonitor

ABSENT_SAMPLES, SATURATED_SAMPLES = map(FLEA_COUNTS.of, (ABSENT_S, SATURATED_S))


def run(monitor: ChannelMonitor, *values: float, trusted: bool = True, start: int = 0) -> list:
    return [monitor.step(start + k, v, trusted, "belied") for k, v in enumerate(values)]


def test_a_channel_that_never_had_a_value_is_absent():
    monitor = ChannelMonitor("motor_speed", counts=FLEA_COUNTS)
    run(monitor, *[math.nan] * 200)
    assert (monitor.state.quality, monitor.state.reason) == ("absent", "no value yet")
    run(monitor, 1.0, start=200)
    assert (monitor.state.quality, monitor.state.since_ns) == ("good", 200)


def test_a_channel_that_falls_silent_is_bad_and_comes_back():
    monitor = ChannelMonitor("motor_current", counts=FLEA_COUNTS)
    run(monitor, 1.0, *[math.nan] * (ABSENT_SAMPLES - 1))
    assert monitor.state.quality == "good"
    run(monitor, math.nan, start=ABSENT_SAMPLES)
    assert (monitor.state.quality, monitor.state.since_ns) == ("bad", ABSENT_SAMPLES)
    run(monitor, 1.0, start=99)
    assert (monitor.state.quality, monitor.state.since_ns) == ("good", 99)
    assert monitor.counters["missing"] == ABSENT_SAMPLES
    assert monitor.counters["samples"] == ABSENT_SAMPLES + 2


@pytest.mark.parametrize("value", [-5.1, 5.1, math.inf, -math.inf, 1e300])
def test_what_is_out_of_range_is_not_used_and_in_the_long_run_bad(value):
    monitor = ChannelMonitor("motor_current", -5.0, 5.0, counts=FLEA_COUNTS)
    used = run(monitor, 1.0, *[value] * ABSENT_SAMPLES)
    assert used[0] == 1.0
    assert all(map(math.isnan, used[1:]))
    assert monitor.counters["out_of_range"] == ABSENT_SAMPLES
    assert monitor.counters["missing"] == 0
    assert monitor.state.quality == "bad"


@pytest.mark.parametrize("value", [math.inf, -math.inf, 1e12, -1e200])
def test_without_a_range_no_sensor_reads_numbers_beyond_all_bounds(value):
    monitor = ChannelMonitor("motor_current", counts=FLEA_COUNTS)
    assert math.isnan(run(monitor, value)[0])
    assert monitor.counters["out_of_range"] == 1
    assert monitor.counters["saturated"] == 0


def test_a_channel_at_its_limit_is_saturated():
    monitor = ChannelMonitor("actuator_position", 0.0, 0.1, counts=FLEA_COUNTS)
    assert run(monitor, *[0.1] * SATURATED_SAMPLES) == [0.1] * SATURATED_SAMPLES
    assert monitor.state.quality == "saturated"
    assert "0.0 to 0.1" in monitor.state.reason
    run(monitor, 0.09)
    assert monitor.state.quality == "good"
    assert monitor.counters["saturated"] == SATURATED_SAMPLES


def test_a_channel_that_others_belie_is_bad_with_their_words():
    monitor = ChannelMonitor("motor_voltage", -30.0, 30.0, counts=FLEA_COUNTS)
    assert run(monitor, 1.0, 2.0, trusted=False) == [1.0, 2.0]
    assert (monitor.state.quality, monitor.state.reason) == ("bad", "belied")
    assert monitor.counters["implausible"] == 2
