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

"""Jumps and holds of one reading, scan by scan."""

from __future__ import annotations

import math

import pytest

from flea_diag.core.sensors.reading_guard import ReadingGuard
from flea_diag.core.sensors.sensor_limits import SensorLimit
from flea_diag.core.sensors.sensor_set import SensorSet

COUNT = 0.15
LIMIT = SensorLimit("motor_speed", 0.0, 0.0, 1.0, repeats=7, reach=20.0, step=0.0, k=5.0)


def drop_outs(readings: list[float], quantum: float = 0.5) -> int:
    guard = ReadingGuard(LIMIT, 0.01, quantum)
    guard.wake(*readings[:3])
    for scan, value in enumerate(readings[3:]):
        guard.take(scan, value, at_end=False)
    return len(guard.events)


def test_an_encoder_that_counts_alike_in_a_steady_motion_has_no_drop_out() -> None:
    steady = [100 * COUNT] * 10 + [101 * COUNT] * 9 + [100 * COUNT] * 9 + [99 * COUNT]
    assert drop_outs(steady) == 0
    assert drop_outs(steady, quantum=0.0) == 3  # of a reading that does not count


def test_a_count_is_the_more_speed_the_shorter_the_scan_is() -> None:
    """4096 counts a turn: 0.15 rad/s at 100 Hz and 1.5 rad/s at 1 kHz, where it holds longer."""
    sensors = SensorSet.of({"motor_speed": 0.5}, {}, "motor_speed", period_s=0.01)
    fast = 2.0 * math.pi / 4096 / 0.001
    steady = [52 * fast] * 50 + [53 * fast] * 50 + [52 * fast] * 50 + [51 * fast]
    assert drop_outs(steady, sensors.speed_of_a_count(0.001)) == 0
    assert drop_outs(steady, sensors.speed_of_a_count(0.01)) == 3
    assert [sensors.speed_of_a_count(slow_s) for slow_s in (0.01, 0.04)] == [0.5, 0.5]


@pytest.mark.parametrize("turns", [-1.0, 1.0])
def test_a_motion_that_lingers_on_a_count_and_goes_on_as_it_came_has_no_drop_out(turns) -> None:
    """Counts of 0.157 rad/s: a speed that slows down, one that turns, one that begins to rest."""
    for before, level, after in (
        ([-28.1, -27.0, -25.9], -24.5, [-23.9, -21.8, -19.8]),
        ([-26.4, -23.2, -21.5], -20.9, [-21.05, -20.4, -17.8]),
        ([5.8, 3.1, 1.6], 0.0, [-0.16, -0.31, -0.79]),
    ):
        assert drop_outs([turns * r for r in (*before, *[level] * 8, *after)]) == 0


@pytest.mark.parametrize("level", [-24.5, 0.0])
def test_a_reading_that_is_held_while_the_motion_goes_on_has_dropped_out(level) -> None:
    """Eight scans later it goes on from where the motion is, not from where it was held."""
    assert drop_outs([-28.1, -27.0, -25.9, *[level] * 8, -14.6, -13.4, -12.1]) == 1


@pytest.mark.parametrize("held", [3, 5, 8])
def test_a_reading_that_jumps_to_a_value_holds_it_and_jumps_back_has_dropped_out(held) -> None:
    moves = [60.0, 60.1, 60.3, 60.2, 60.4]
    assert drop_outs(moves + [0.0] * held + moves) == 1


def test_noise_that_jumps_both_ways_holds_nothing() -> None:
    assert drop_outs([60.0, 60.1, 60.2, 1.0, 2.0, 0.5, 1.5, 60.1, 60.0, 60.3]) == 0


@pytest.mark.parametrize("share", [1.0, 0.6])
def test_a_reading_that_goes_on_one_way_faster_than_any_nominal_one_moves(share: float) -> None:
    guard = ReadingGuard(LIMIT, 0.01)
    guard.wake(60.0, 60.0, 60.1)
    runs_away = [85.0 + share * 25.0 * k for k in range(20)]
    taken = [
        guard.take(k, v, False) for k, v in enumerate(runs_away + [560.0 + k for k in range(20)])
    ]
    assert [withheld for withheld, _ in taken] == [True] + [False] * 39
    assert not any(leapt for _, leapt in taken)
