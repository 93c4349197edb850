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

"""A test fitted to recordings, each judged by the others, against plain loops."""

from __future__ import annotations

import numpy as np
import pytest

from flea_diag.core.calibration.limits.window_fit import (
    GUARD,
    WindowStatistic,
    others_of,
    window_fit,
)


def drawn(scales: list[float], seed: int = 0) -> list[WindowStatistic]:
    """Recordings of 200 samples in two regions, the first of which is twice as loud."""
    draw = np.random.default_rng(seed)
    found = []
    for scale in scales:
        region = draw.integers(0, 2, 200)
        values = scale * draw.standard_normal(200) * np.where(region == 0, 2.0, 1.0)
        found.append(WindowStatistic(values, region, np.zeros(200)))
    return found


def test_each_recording_is_judged_by_moments_of_the_others() -> None:
    rows = drawn([1.0] * 5 + [3.0])
    fit = window_fit("r", 50, rows, 2, 4.0, others_of("abcdef"))
    assert fit is not None
    for each, row in enumerate(rows):
        worst = 0.0
        for region in (0, 1):
            parts = [r.values[r.region == region] for r in rows[:each] + rows[each + 1 :]]
            centre = np.mean([part.mean() for part in parts])
            sigma = np.mean([np.mean((part - centre) ** 2) for part in parts]) ** 0.5
            mine = np.abs(row.values[row.region == region] - centre).max() / sigma
            worst = max(worst, float(mine))
        assert fit.maxima[each] == pytest.approx(worst)
    assert fit.k == pytest.approx(GUARD * fit.maxima[5])
    # The limit that judges the loud recording knows nothing of it.
    limit = max(4.0, GUARD * fit.maxima[:5].max())
    assert fit.scores(others_of("abcdef"))[5] == pytest.approx(fit.maxima[5] / limit)


def test_what_units_differ_by_lowers_the_score_and_not_the_limit() -> None:
    rows = drawn([1.0] * 6)
    wide = [WindowStatistic(row.values, row.region, np.full(200, 9.0)) for row in rows]
    one, other = (window_fit("r", 50, r, 2, 4.0, others_of("abcdef")) for r in (rows, wide))
    assert one is not None
    assert other is not None
    assert one.k == other.k
    assert (other.tested < 0.7 * one.tested).all()


def test_recordings_of_one_unit_are_left_out_together() -> None:
    others = others_of(["u1", "u1", "u2"])
    assert others.tolist() == [[False, False, True], [False, False, True], [True, True, False]]


@pytest.mark.parametrize("rows", [drawn([1.0]), drawn([0.0, 0.0])])
def test_one_recording_or_no_scatter_gives_no_test(rows: list[WindowStatistic]) -> None:
    assert window_fit("r", 50, rows, 2, 4.0, others_of("ab"[: len(rows)])) is None
