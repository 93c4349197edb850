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

"""A filter without a matrix against the whole Gaussian, and windows against their scans."""

from __future__ import annotations

import numpy as np
import pytest

from flea_diag.core.run_law.level_noise import LevelNoise
from flea_diag.core.run_law.run_windows import windows_of
from flea_diag.core.run_law.whitening import GainSequence, WhiteSignals

WHITE, COLOURED, PHI = np.array([0.5, 0.1]), np.array([0.3, 0.9]), np.array([0.6, 0.8])
COUNT, MISSING = 12, (3, 4, 9)


def noise(start: float = 0.0, walk: float = 0.0) -> LevelNoise:
    """Of two residuals."""
    return LevelNoise(WHITE, COLOURED, PHI, np.full(2, walk), np.full(2, start))


@pytest.mark.parametrize(("start", "walk"), [(0.0, 0.0), (2.0, 0.05)])
def test_innovations_are_those_of_the_whole_gaussian(start: float, walk: float) -> None:
    """Their squares and scales add up to its density, for the values that there are."""
    y = np.random.default_rng(1).normal(0.0, 1.0, (COUNT, 2))
    known = np.ones((COUNT, 2), dtype=bool)
    known[list(MISSING), 1] = False
    gains, signals = GainSequence(noise(start, walk)), WhiteSignals((2, 1))
    white, scales = [], []
    for row, here in zip(y, known, strict=True):
        gain = gains.step(here)
        white.append(signals.step(np.where(here, row, 0.0)[:, None], gain)[:, 0])
        scales.append(gain.scale[:, 0])
    made, scale = np.array(white), np.array(scales)
    lag = np.abs(np.subtract.outer(np.arange(COUNT), np.arange(COUNT)))
    steps = np.minimum.outer(np.arange(COUNT), np.arange(COUNT))
    for k in range(2):
        whole = WHITE[k] * np.eye(COUNT) + COLOURED[k] * PHI[k] ** lag + start + walk * steps
        here = known[:, k]
        part, values = whole[np.ix_(here, here)], y[here, k]
        square = values @ np.linalg.solve(part, values)
        assert (made[here, k] ** 2).sum() == pytest.approx(square)
        assert -2.0 * np.log(scale[here, k]).sum() == pytest.approx(np.linalg.slogdet(part)[1])
        assert not made[~here, k].any()


def test_a_signal_that_begins_later_is_one_that_was_zero_until_then() -> None:
    rows = np.random.default_rng(2).normal(0.0, 1.0, (8, 3, 2, 4))
    rows[:5, 2] = 0.0
    gains = GainSequence(noise())
    whole, grown = WhiteSignals((3, 2, 4)), WhiteSignals((2, 2, 4))
    for number, row in enumerate(rows):
        gain = gains.step(np.ones(2, dtype=bool))
        if number == 5:
            grown.begin()
        expected = whole.step(row, gain)
        found = grown.step(row[: 3 if number >= 5 else 2], gain)
        np.testing.assert_array_equal(found, expected[: len(found)])
    kept = np.array([True, False, True])
    gain = gains.step(np.ones(2, dtype=bool))
    grown.keep(kept)
    np.testing.assert_array_equal(grown.step(rows[0][kept], gain), whole.step(rows[0], gain)[kept])


def test_a_window_is_the_mean_of_its_scans_where_most_of_them_have_a_value() -> None:
    values = np.arange(24.0).reshape(12, 2)
    values[1:3, 0] = np.nan  # half of the first window, which is too few
    values[4, 0] = np.nan
    signals = np.random.default_rng(3).normal(0.0, 1.0, (12, 2, 3))
    signals[9, 1, 2] = np.nan
    still = np.zeros(12)
    # Three scans more than three windows of four would be left out.
    found = windows_of("run", "unit", values[:11], signals[:11], (still, still, still[:11]), 4)
    assert len(found) == 2
    assert np.isnan(found.values[0, 0])
    assert found.values[0, 1] == pytest.approx(values[:4, 1].mean())
    assert found.values[1] == pytest.approx([values[5:8, 0].mean(), values[4:8, 1].mean()])
    assert found.signals[1, 0] == pytest.approx(signals[5:8, 0].mean(axis=0))
    assert found.signals[1, 1] == pytest.approx(signals[4:8, 1].mean(axis=0))
