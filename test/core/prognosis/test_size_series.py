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

"""What recordings of one unit share, and the straight line through their sizes."""

from __future__ import annotations

import math

import numpy as np
import pytest

from flea_diag.core.likelihood.fit import SizeError
from flea_diag.core.prognosis.size_series import SizeSeries, against_new, falls
from flea_diag.core.prognosis.trend import further_needed, trend

OWN, SHARED = 0.04, 0.3


def series(sizes: list[float], own: float = OWN, shared: float = SHARED) -> SizeSeries:
    """Sizes a second apart."""
    return SizeSeries.of(range(len(sizes)), sizes, [SizeError(own, (shared,))] * len(sizes))


def test_an_error_is_the_unit_and_the_recording() -> None:
    error = SizeError(0.3, (0.0, 0.4))
    assert error.shared == pytest.approx(0.4)
    assert error.total == pytest.approx(0.5)


def test_without_what_is_shared_the_line_is_that_of_weighted_least_squares() -> None:
    random = np.random.default_rng(3)
    t = np.sort(random.uniform(0.0, 100.0, 12))
    sigma = random.uniform(0.5, 2.0, 12)
    y = 5.0 + 0.3 * t + sigma * random.normal(size=12)
    (slope, offset), covariance = np.polyfit(t, y, 1, w=1.0 / sigma, cov="unscaled")
    line = trend(SizeSeries.of(t.tolist(), y.tolist(), [SizeError(s) for s in sigma.tolist()]))
    assert line.slope == pytest.approx(slope)
    assert line.level == pytest.approx(offset + slope * line.middle)
    scatter = float(np.sum(((y - offset - slope * t) / sigma) ** 2))
    scale = math.sqrt((4.0 + scatter) / (4.0 + 10.0))
    assert line.slope_sigma == pytest.approx(math.sqrt(covariance[0, 0]) * scale)


def test_what_is_shared_is_in_the_level_and_not_in_the_slope() -> None:
    sizes = [0.0, 0.1, 0.2, 0.3]
    alone, of_a_unit = trend(series(sizes, shared=0.0)), trend(series(sizes))
    assert of_a_unit.slope_sigma == pytest.approx(alone.slope_sigma)
    assert of_a_unit.level_sigma == pytest.approx(math.hypot(alone.level_sigma, SHARED))
    whole = SizeSeries.of(range(4), sizes, [SizeError(math.hypot(OWN, SHARED))] * 4)
    assert of_a_unit.direction == "grows"
    assert trend(whole).direction == "no trend is shown", "the same errors, each by itself"


def test_growth_by_two_own_errors_a_recording_is_mostly_shown_by_the_third() -> None:
    random = np.random.default_rng(7)

    def shown(step: float) -> float:
        found = []
        for _ in range(1000):
            noise, unit = random.normal(size=3), random.normal()
            sizes = OWN * (step * np.arange(3) + noise) + SHARED * unit
            found.append(trend(series(sizes.tolist())).direction == "grows")
        return float(np.mean(found))

    assert shown(2.0) > 0.7
    assert shown(0.0) < 0.04


def test_one_time_gives_no_slope() -> None:
    for line in (trend(series([2.0])), trend(series([2.0, 3.0]).part(slice(1)))):
        assert math.isnan(line.slope)
        assert line.direction == "no trend is shown"
    same = SizeSeries.of([1.0, 1.0], [2.0, 3.0], [SizeError(0.1)] * 2)
    assert math.isnan(trend(same).slope)


def test_recordings_as_new_tell_what_the_unit_differs_by() -> None:
    unit = 0.25 + 5.0 * SHARED  # what a relation neglects is in it, and in no stated error
    new, worn = series([unit, unit, unit]), series([unit + 0.1, unit + 0.2])
    told = against_new(worn, new)
    assert told.sizes == pytest.approx([0.1, 0.2], abs=0.01)
    # Of the error of the unit that of the mean of three recordings is left; these do not scatter.
    own = OWN * math.sqrt(4.0 / (4.0 + 2.0))
    left = own / math.sqrt(3.0)
    assert float(np.linalg.norm(told.from_unit[0])) == pytest.approx(left, rel=1e-4)
    assert told.own == pytest.approx(own)


def test_a_size_that_falls_is_seen_and_noise_is_not() -> None:
    assert falls(series([0.1, 0.3, 0.5, 0.1, 0.2])) == [3]
    assert falls(series([0.1, 0.0, 0.1, 0.0])) == []
    assert falls(series([0.1])) == []


def test_it_is_said_how_many_more_recordings_are_needed() -> None:
    slow = series([0.0, 0.02, 0.04])
    line = trend(slow)
    assert line.direction == "no trend is shown"
    more = further_needed(slow, line)
    assert more is not None
    longer = series([0.02 * k for k in range(3 + more)], own=OWN * line.scale)
    assert trend(longer).slope / (OWN * line.scale) > 0.0
    spread = math.sqrt(float(np.sum(np.square(np.arange(3 + more) - (2 + more) / 2.0))))
    assert 2.0 * OWN * line.scale / spread < 0.02
    assert further_needed(series([0.1, 0.1, 0.1]), trend(series([0.1, 0.1, 0.1]))) in (None, 0)
