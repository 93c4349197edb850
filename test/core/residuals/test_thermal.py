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

import numpy as np
import pytest
from support import stands

from flea_diag.core.residuals.leverage import CalibrationEnvelope
from flea_diag.core.residuals.thermal import (
    CORRECTION_S,
    ESTIMATE,
    Heating,
    PredictedStores,
)

MOST, NOISE = 0.05, 0.1
"""Most that was supplied, unit per second, and the noise of a reading."""


def node(cooling_s: float = 800.0, start_samples: int = 2) -> PredictedStores:
    """One store whose rows hold its reading and that of the air; its residual comes first."""
    state = np.array([[math.nan, 0.0, 0.0, start_samples, 0.0, 0.0, 0.0]])
    rates, bounds = np.array([[1.0 / cooling_s]]), np.array([[MOST, NOISE]])
    return PredictedStores(state, np.array([[0, 0, 1]]), rates, bounds)


def step(
    made: PredictedStores,
    measured: float,
    heating: float,
    ambient: float,
    dt_s: float,
    frozen: bool,
) -> float:
    values = np.empty((1, 1))
    made.follow(np.array([[measured, ambient]]), [heating], dt_s, frozen, values)
    return float(values[0, 0])


def estimate_degc(made: PredictedStores) -> float:
    return float(made.states[0, ESTIMATE])


def started(level: float) -> PredictedStores:
    made = node()
    assert math.isnan(step(made, level - 1.0, 0.0, 24.0, 0.01, frozen=True))
    assert math.isnan(step(made, level + 1.0, 0.0, 24.0, 0.01, frozen=True))
    assert estimate_degc(made) == level
    return made


def test_heating_follows_the_exponential():
    made, q, tau = started(30.0), 0.05, 800.0
    for _ in range(60_000):
        step(made, 0.0, q, 24.0, 0.01, frozen=True)
    final = 24.0 + q * tau
    assert estimate_degc(made) == pytest.approx(
        final + (30.0 - final) * math.exp(-600.0 / tau), 1e-5
    )


def test_a_step_of_the_sensor_decays_with_the_correction_time():
    made = started(24.0)
    residuals = [step(made, 29.0, 0.0, 24.0, 0.01, frozen=False) for _ in range(1501)]
    assert residuals[0] == 5.0
    rate = 1.0 / CORRECTION_S + 1.0 / 800.0
    steady = 5.0 * (1.0 / 800.0) / rate
    # Rates 1/15 and 1/800 act together: 5 K decay towards what cooling leaves.
    assert residuals[-1] == pytest.approx(
        steady + (5.0 - steady) * math.exp(-15.0 * rate), rel=2e-3
    )


def test_frozen_is_blind_to_the_sensor():
    made = started(24.0)
    assert [step(made, 29.0, 0.0, 24.0, 0.01, frozen=True) for _ in range(500)] == [5.0] * 500


def test_what_is_thawed_follows_the_sensor_whatever_is_frozen():
    frozen, free = started(24.0), started(24.0)
    frozen.thaw([0])
    for _ in range(500):
        told = [step(made, 29.0, 0.0, 24.0, 0.01, is_frozen)
                for made, is_frozen in ((frozen, True), (free, False))]  # fmt: skip
        assert told[0] == told[1]
    frozen.thaw([])
    kept = estimate_degc(frozen)
    step(frozen, 29.0, 0.0, kept, 0.01, frozen=True)
    assert estimate_degc(frozen) == kept


def test_what_is_missing_neither_heats_nor_corrects():
    made = started(30.0)
    assert math.isnan(step(made, math.nan, math.nan, math.nan, 0.01, frozen=False))
    assert estimate_degc(made) == 30.0
    step(made, math.nan, 0.5, math.nan, 0.01, frozen=False)
    assert estimate_degc(made) == pytest.approx(30.005)


def test_it_waits_for_its_first_readings():
    made = node(start_samples=3)
    for value in (math.nan, 20.0, math.nan, 22.0):
        assert math.isnan(step(made, value, 1.0, 24.0, 0.01, frozen=False))
    assert math.isnan(step(made, 27.0, 1.0, 24.0, 0.01, frozen=False))
    assert step(made, 25.0, 0.0, 24.0, 0.01, frozen=False) == pytest.approx(25.0 - 23.0)


def test_every_store_follows_its_own_neighbours_in_one_row():
    """Two bodies that exchange heat with each other alone meet in the middle."""
    states = np.array(
        [[60.0, 60.0, 1.0, 1.0, 0.0, 0.0, 0.0], [20.0, 20.0, 1.0, 1.0, 0.0, 0.0, 0.0]]
    )
    places, bounds = np.array([[0, 0, 1], [1, 1, 0]]), np.full((2, 2), MOST)
    made = PredictedStores(states, places, np.full((2, 1), 0.5), bounds)
    for _ in range(2000):
        made.follow(made.states[:, ESTIMATE][None], [0.0, 0.0], 0.01, True, np.empty((1, 2)))
    assert made.states[:, ESTIMATE] == pytest.approx([40.0, 40.0], abs=1e-6)


def judged(made: PredictedStores, scans: int, heating: float, frozen: bool) -> list[bool]:
    """After which scans of 0.01 s a reading of 25 has a residual."""
    values = np.empty((scans, 1))
    made.follow(np.full((scans, 2), 25.0), [heating], 0.01, frozen, values)
    return np.isfinite(values[:, 0]).tolist()


def test_a_moment_of_unknown_heat_leaves_a_store_judged():
    made = started(25.0)
    assert all(judged(made, 190, math.nan, frozen=True))
    assert all(judged(made, 1000, 0.0, frozen=True))


@pytest.mark.slow
@pytest.mark.parametrize("frozen", [True, False])
@pytest.mark.parametrize(("before", "level"), [(0.01, MOST), (0.15, 0.15), (-0.15, 0.15)])
def test_unknown_heat_leaves_a_store_unjudged_until_it_has_faded(frozen, before, level):
    """It may have gone on as it was, or have been the most that was seen."""
    made = started(25.0)
    judged(made, 1, before, frozen)
    during = judged(made, 1000, math.nan, frozen)
    rate = 1.0 / 800.0 + (0.0 if frozen else 1.0 / CORRECTION_S)
    assert sum(during) == pytest.approx(-math.log1p(-rate * NOISE / level) / rate / 0.01, abs=2)
    after = judged(made, 260_000, 0.0, frozen)
    gathered = level / rate * -math.expm1(-10.0 * rate)
    assert after == sorted(after)
    assert after.count(False) == pytest.approx(math.log(gathered / NOISE) / rate / 0.01, rel=2e-3)


def test_what_is_unjudged_is_corrected_all_the_same():
    made, rows = started(25.0), np.tile([28.0, 25.0], (6000, 1))
    made.follow(rows, [math.nan], 0.01, False, np.empty((6000, 1)))
    assert estimate_degc(made) == pytest.approx(28.0, abs=0.15)


@pytest.mark.parametrize("block", [1, 700, 3000])
def test_what_is_heated_is_ahead_unless_by_heat_that_no_recording_had(block):
    """A current of 4 A all the time, and for half a second of 40 A, which is none of the ranges."""
    p, relations, period_s = stands.calibration().parameters, stands.relations(), 0.01
    flow = p.motor_heating_k_per_a2s * 4.0**2
    ranges = {"motor_current": (-6.0, 6.0)}
    envelope = CalibrationEnvelope("", (), ranges, supplies={"motor_temperature": flow})
    signals = np.zeros((3000, len(relations.signals)))
    current = relations.signals.index("motor_current")
    signals[:, current] = p.current_offset_a + 4.0
    signals[1500:1550, current] = 40.0
    heating = Heating(relations, p, period_s, envelope)
    parts = [heating.step(signals[k : k + block]) for k in range(0, 3000, block)]
    share, supplied = (np.concatenate(part) for part in zip(*parts, strict=True))
    late = np.arange(1, 1501) * period_s / CORRECTION_S
    stores = [row.name for row in relations.predictions]
    once = stores.index("motor_temperature")
    twice = once + len(stores)
    assert share[:1500, once] == pytest.approx(-np.expm1(-late), abs=1e-3)
    assert np.array_equal(supplied[:1500, : len(stores)], share[:1500])
    assert supplied[:1500, twice] == pytest.approx(1.0 - (1.0 + late) * np.exp(-late), abs=1e-3)
    unknown = np.isnan(supplied)
    assert unknown[1550:, once].all()
    assert not unknown[:1500].any()
    assert np.isfinite(share).all()
