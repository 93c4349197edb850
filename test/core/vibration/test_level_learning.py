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

"""Ranges of levels, against the monitor that they are for and against fresh healthy units."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import stats

from flea_diag.core.vibration.level_learning import LEAST_RUNS, Levels, gumbel, held, learn_levels
from flea_diag.core.vibration.nominal_range import (
    NominalRange,
    NominalRanges,
    VibrationOperatingPoint,
    learn_nominal,
)
from flea_diag.core.vibration.vibration_monitor import RAISED, VibrationMonitor

AXIS = "accelerometer_2_x"
RATE = 0.05


def watch(nominal: NominalRange, run: Levels) -> bool:
    """Whether a run raises the alarm."""
    ranges = NominalRanges(levels={AXIS: nominal}, resting_levels={AXIS: nominal})
    monitor = VibrationMonitor(ranges)
    found = []
    for point, levels in run:
        monitor.motion(point.speed_rad_s, point.load_n)
        found.append(monitor.step(tuple(levels), tuple(levels.values())))
    return any(alarm is not None for alarm in found)


def constant_motion(values: np.ndarray) -> Levels:
    return [(VibrationOperatingPoint(80.0, 100.0), {AXIS: float(value)}) for value in values]


@pytest.mark.parametrize("seed", range(10))
def test_what_a_run_holds_is_the_highest_limit_at_which_the_monitor_alarms(seed: int) -> None:
    draw = np.random.default_rng(seed)
    values = draw.normal(size=draw.integers(RAISED, 40))
    found = held(values)
    for limit, called in ((found - 1e-9, True), (found + 1e-9, False)):
        assert watch(NominalRange((0.0,), -1e3, limit), constant_motion(values)) is called


def healthy_units(seed: int, count: int) -> list[Levels]:
    """Units louder or quieter than each other, blocks that scatter; motion and rest by turns."""
    draw = np.random.default_rng(seed)
    runs = []
    for _ in range(count):
        own = 0.1 * draw.normal()
        run = []
        for k in range(120):
            speed = 90.0 if k % 40 < 25 else 2.0
            level = (0.2 + speed / 100.0) * np.exp(own + 0.15 * draw.normal())
            run.append((VibrationOperatingPoint(speed, 100.0), {AXIS: float(level)}))
        runs.append(run)
    return runs


@pytest.mark.slow
def test_as_many_healthy_units_call_as_was_stated_and_fewer_blocks_are_needed() -> None:
    learned_on, fresh = healthy_units(1, 300), healthy_units(2, 600)
    moving = learn_levels(learned_on, RATE, moving=True)[AXIS]
    share = np.mean([watch(moving, [row for row in run if row[0].moving]) for run in fresh])
    # 5 % of 600 with a limit learned on 300: four standard deviations are 4.4 %.
    assert 0.01 < share < 0.095
    blocks = [row for run in learned_on for row in run if row[0].moving]
    single = learn_nominal(
        [levels[AXIS] for _, levels in blocks], RATE, [p for p, _ in blocks], logarithmic=True
    )
    assert moving.high < 0.9 * single.high


def test_a_rate_that_no_run_of_these_shows_is_predicted_by_the_law_of_the_largest() -> None:
    """One in 10 000, from 300 runs: 6.7 deviations of what runs hold, and none calls."""
    learned_on = healthy_units(1, 300)
    rare = learn_levels(learned_on, 2e-4, moving=True)[AXIS]
    rests = [
        [np.log(levels[AXIS]) - rare.centre(point) for point, levels in run if point.moving]
        for run in learned_on
    ]
    ends = np.array([held(np.array(rest)) for rest in rests])
    assert rare.high >= ends.max()
    assert (rare.high - ends.mean()) / ends.std() == pytest.approx(6.73, abs=0.05)
    assert not any(watch(rare, [r for r in run if r[0].moving]) for run in healthy_units(5, 200))


def test_levels_at_rest_are_another_range_and_few_runs_make_none() -> None:
    runs = healthy_units(3, 40)
    moving, resting = (learn_levels(runs, RATE, moving=state)[AXIS] for state in (True, False))
    assert moving.centre(VibrationOperatingPoint(90.0, 100.0)) == pytest.approx(
        np.log(1.1), abs=0.1
    )
    assert resting.centre(VibrationOperatingPoint(2.0, 100.0)) == pytest.approx(
        np.log(0.22), abs=0.1
    )
    assert moving.count == resting.count == 40
    assert learn_levels(runs[: LEAST_RUNS - 1], RATE, moving=True) == {}


@pytest.mark.parametrize("rate", [1e-2, 1e-4, 1e-6])
def test_the_law_of_the_largest_is_that_of_scipy(rate: float) -> None:
    law = stats.gumbel_r
    assert gumbel(rate) == pytest.approx((law.isf(rate) - law.mean()) / law.std(), rel=1e-6)
