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

"""Limits of a reading at other rates: what looks like a step, and times in seconds."""

from __future__ import annotations

import numpy as np
import pytest

from flea_diag.core.sensors.position_step import position_steps
from flea_diag.core.sensors.reading_guard import ReadingGuard, stuck_scans
from flea_diag.core.sensors.sensor_limits import (
    REACH_GUARD,
    STEP_GUARD,
    SensorLimit,
    sensor_limits,
)
from flea_diag.core.sensors.sensor_set import SensorSet

SENSORS = SensorSet.of({"actuator_position": 6e-5}, {"actuator_position": "m"}, "")


def strokes(period_s: float, kick_m: float) -> np.ndarray:
    """Strokes at 24 mm/s with rests, each with a kick within a scan halfway."""
    time_s = np.arange(0.0, 60.0, period_s)
    phase = time_s % 13.0
    way = np.clip(phase, 0.0, 5.0) - np.clip(phase - 6.5, 0.0, 5.0)
    kicked = np.where((phase > 2.5) & (phase < 9.0), kick_m, 0.0)
    return np.asarray(0.02 + 0.024 * way + kicked)


@pytest.mark.parametrize(
    ("period_s", "kick_m", "of_way", "of_sudden"),
    [(0.04, 2.0e-3, REACH_GUARD, 0.0), (0.005, 5.0e-5, 0.0, STEP_GUARD), (0.005, 0.0, 0.1, 0.0)],
    ids=["starts look like a step", "the largest step counts", "a finely read position"],
)
def test_a_step_is_no_shorter_than_healthy_motion_may_look(
    period_s: float, kick_m: float, of_way: float, of_sudden: float
) -> None:
    columns = [strokes(period_s, share * kick_m) for share in (1.0, 0.9)]
    (limit,) = sensor_limits([{"actuator_position": c} for c in columns], SENSORS, 0.1, period_s)
    way = max(float(np.quantile(np.abs(np.diff(c)), 0.999)) for c in columns)
    sudden = max(float(np.abs(position_steps(c)).max()) for c in columns)
    assert (sudden > 0.5 * way) == (of_way == REACH_GUARD)
    assert limit.step == pytest.approx(of_way * way + of_sudden * sudden)


def test_a_largest_step_that_happens_to_be_small_is_not_the_limit_of_noise() -> None:
    rng = np.random.default_rng(3)
    period_s, noise_m = 0.005, 2.0e-5
    short = [strokes(period_s, 0.0) + rng.normal(0.0, noise_m, 12_000) for _ in range(2)]
    (limit,) = sensor_limits([{"actuator_position": c} for c in short], SENSORS, 0.1, period_s)
    largest = max(float(np.abs(position_steps(c)).max()) for c in short)
    noisier = np.abs(position_steps(rng.normal(0.0, STEP_GUARD * noise_m, 3 * 720_000)))
    assert (noisier > STEP_GUARD * largest).sum() > 200
    assert (noisier > limit.step).sum() < 20


@pytest.mark.parametrize("period_s", [0.01, 0.005, 0.02])
def test_a_position_that_jumps_is_accepted_after_a_tenth_of_a_second_at_any_rate(
    period_s: float,
) -> None:
    limit = SensorLimit("actuator_position", 0.0, 1.0, 1.0, 0, 0.5, 0.3, 5.0)
    guard = ReadingGuard(limit, period_s)
    withheld = sum(guard.take(scan, float(scan > 5), False)[0] for scan in range(200))
    assert withheld * period_s == pytest.approx(0.1, abs=period_s)


@pytest.mark.parametrize("stays", [1, 40])
def test_of_a_current_that_jumps_the_first_reading_alone_may_be_an_outlier(stays: int) -> None:
    """A machine may make it jump, as an opening does."""
    guard = ReadingGuard(SensorLimit("motor_current", 0.0, 1.0, 1.0, 0, 0.5, 0.0, 5.0), 0.01)
    told = []
    for scan in range(100):
        withheld, _ = guard.take(scan, float(5 < scan <= 5 + stays), False)
        assert withheld == guard.outlying
        told.append(withheld)
    back = [46] if stays > 1 else []
    assert np.flatnonzero(told).tolist() == [6, *back]


@pytest.mark.parametrize("period_s", [0.01, 0.005, 0.02])
def test_a_reading_is_stuck_after_half_a_second_at_any_rate(period_s: float) -> None:
    limit = SensorLimit("motor_current", 0.0, 1.0, 1.0, 4, 0.5, 0.0, 5.0)
    assert stuck_scans(limit, period_s) * period_s == pytest.approx(0.5)
