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

"""Shifts of coefficients within a run, whatever the parameters of its unit are."""

from __future__ import annotations

import numpy as np
import pytest
from support.observed import FLEA_COUNTS

from flea_diag.core.detection.coefficient_shift import (
    BIN_S,
    COEFFICIENT_WINDOWS_S,
    CoefficientShift,
)
from flea_diag.core.detection.mean_shift import LEAST_S, REFERENCE_S

BIN, REFERENCE, LEAST = map(FLEA_COUNTS.of, (BIN_S, REFERENCE_S, LEAST_S))
WINDOWS = tuple(map(FLEA_COUNTS.of, COEFFICIENT_WINDOWS_S))
SIGMA = 0.1


def level(readings: int = 1) -> CoefficientShift:
    return CoefficientShift(2, readings, SIGMA, counts=FLEA_COUNTS)


def recorded(count: int, shift: float = 0.0, readings: int = 1) -> np.ndarray:
    """psi, the residual and the readings of a unit that is another than calibrated."""
    draw = np.random.default_rng(4)
    time = np.arange(count) * 0.01
    speed, load = np.sin(2.0 * time), 1.5 + np.sin(0.3 * time)
    psi = np.stack((0.3 * load, np.full(count, 0.2)), axis=1)
    residual = psi @ [2.0, -1.0] + SIGMA * draw.standard_normal(count)
    residual[count // 2 :] += shift * speed[count // 2 :]
    return np.column_stack((psi, residual, *([speed] * readings)))


def test_a_coefficient_and_its_error_are_those_of_least_squares():
    rows = recorded(4000, 0.4)
    found = level().step(rows, np.ones(len(rows), dtype=bool))
    now = 2400
    for window, (z, shift) in zip(WINDOWS, found[now - 1, :, 0].T, strict=True):
        begin = max(now - window - REFERENCE, 0)
        psi, residual, reading = np.split(rows[begin:now], [2, 3], axis=1)
        along = np.where(np.arange(begin, now)[:, None] >= now - window, reading, 0.0)
        columns = np.concatenate((psi, along), axis=1)
        variance = SIGMA**2 * BIN
        inverse = np.linalg.inv(columns.T @ columns / variance + np.diag([1.0, 1.0, 0.0]))
        size = (inverse @ columns.T @ residual / variance)[-1, 0]
        side = np.sign(along[-BIN:].sum())
        assert z == pytest.approx(side * size / np.sqrt(inverse[-1, -1]))
        rms = np.sqrt(np.square(along).sum() / window)
        assert shift == pytest.approx(side * size * rms)


def test_another_unit_is_no_shift_and_a_scaled_reading_is_one():
    use = np.ones(6000, dtype=bool)
    assert np.nanmax(np.abs(level().step(recorded(6000), use)[:, 0])) < 1.0
    found = np.abs(level().step(recorded(6000, 0.4), use)[:, 0])
    assert np.nanmax(found[:3000]) < 1.0
    assert found[3000 + WINDOWS[2], 0, 2] > 8.0


def test_there_is_none_before_there_is_enough_nor_where_a_reading_is_what_units_differ_by():
    rows = recorded(3000)
    found = level().step(rows, np.ones(3000, dtype=bool))[:, 0, 0]
    first = np.isfinite(found).argmax(axis=0)
    assert first.tolist() == [LEAST + window - 1 for window in WINDOWS]
    rows[:, 3] = 0.0
    assert np.isnan(level().step(rows, np.ones(3000, dtype=bool))).all()


@pytest.mark.parametrize("block", [1, 7, 256])
def test_blocks_give_the_same_bits_with_rests_holes_and_an_episode(block):
    rows = recorded(9000, 0.4, readings=2)
    rows[[300, 301], 2] = np.nan
    rows[700:770, 2] = np.nan
    use = np.random.default_rng(5).random(9000) > 0.2

    def run(size: int) -> np.ndarray:
        shifts, found = level(2), []
        for start, end in ((0, 5000), (5000, 8000), (8000, 9000)):
            if start == 5000:
                shifts.freeze()
            elif start == 8000:
                shifts.clear()
            parts = (slice(k, min(k + size, end)) for k in range(start, end, size))
            found += [shifts.step(rows[part], use[part]) for part in parts]
        return np.concatenate(found)

    whole = run(9000)
    assert np.isfinite(whole[7999]).all()
    assert np.array_equal(whole, run(block), equal_nan=True)


def test_what_came_before_an_episode_does_not_follow_the_fault():
    rows, use = recorded(12000, 0.4), np.ones(1000, dtype=bool)
    shifts = level()
    for start in range(0, 12000, 1000):
        if start == 7000:
            shifts.freeze()
        last = shifts.step(rows[start : start + 1000], use)[-1, 0, 0]
    assert abs(last[2]) > 8.0


@pytest.mark.parametrize("thaws", [False, True])
def test_a_level_that_goes_on_in_an_episode_takes_the_shift_on(thaws: bool):
    """As another unit's: here psi holds the reading."""
    rows, use = recorded(24000, 0.4), np.ones(1000, dtype=bool)
    rows[:, 0] = rows[:, 3]
    shifts = level()
    for start in range(0, 24000, 1000):
        if start == 7000:
            shifts.freeze()
        if start == 16000:
            shifts.thaw(rolls=thaws)
        last = shifts.step(rows[start : start + 1000], use)[-1, 0, 0]
    assert bool(np.abs(last).max() < 4.0) is thaws
