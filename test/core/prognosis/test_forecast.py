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

"""Laws of growth, and when they reach a limit."""

from __future__ import annotations

import math

import numpy as np
import pytest

from flea_diag.core.likelihood.fit import SizeError
from flea_diag.core.prognosis.forecast import forecast
from flea_diag.core.prognosis.growth_law import LAWS, GrowthLaw
from flea_diag.core.prognosis.size_series import SizeSeries

LINEAR, EXPONENTIAL, PARIS = LAWS
SHARES = (0.05, 0.5, 0.95)


def grown(law: GrowthLaw, times: np.ndarray, first: float, last: float) -> np.ndarray:
    low, high = law.straight(first), law.straight(last)
    return law.size(low + times / times[-1] * (high - low))


def series(sizes: np.ndarray, own: float, shared: float = 0.0) -> SizeSeries:
    errors = [SizeError(own, (shared,))] * len(sizes)
    return SizeSeries.of(np.arange(len(sizes), dtype=float).tolist(), sizes.tolist(), errors)


@pytest.mark.parametrize("law", LAWS, ids=lambda law: law.name)
def test_a_law_grows_as_its_power_says(law: GrowthLaw) -> None:
    """da/dt is in proportion to a^p: by differences along a fine course."""
    sizes = grown(law, np.linspace(0.0, 1.0, 2001), 0.1, 0.8)
    assert sizes[[0, -1]] == pytest.approx([0.1, 0.8])
    rates = np.gradient(sizes, 1.0 / 2000)[1:-1] / sizes[1:-1] ** law.power
    assert rates == pytest.approx(np.full(1999, rates[0]), rel=1e-3)


@pytest.mark.parametrize("law", LAWS, ids=lambda law: law.name)
def test_exact_sizes_name_their_law_and_their_end(law: GrowthLaw) -> None:
    end, limit = 20.0, 1.0
    times = np.arange(13.0)
    low, high = law.straight(0.1), law.straight(limit)
    found = forecast(series(law.size(low + times / end * (high - low)), 0.001))
    assert found is not None
    assert max(found.of_laws, key=lambda name: found.of_laws[name]) == law.name
    low_s, median_s, high_s = found.quantiles(found.crossing_s(limit), SHARES)
    assert median_s == pytest.approx(end, rel=0.02)
    assert low_s <= end <= high_s


def test_a_forecast_is_wider_the_less_is_known_of_the_unit() -> None:
    sizes = 0.1 + 0.05 * np.arange(8.0)

    def width(shared: float) -> float:
        found = forecast(series(sizes, 0.01, shared), [LINEAR])
        assert found is not None
        low, _, high = found.quantiles(found.crossing_s(1.0), SHARES)
        return high - low

    assert width(0.2) > 3.0 * width(0.0)


def test_the_end_lies_in_the_interval_as_often_as_it_says() -> None:
    """Lives drawn as the forecast takes them: ends of 90 % intervals hold 90 %, to the noise."""
    random, held = np.random.default_rng(11), 0
    for number in range(60):
        law, end = LAWS[number % 3], 16.0
        low, high = law.straight(random.uniform(0.05, 0.25)), law.straight(1.0)
        true = law.size(low + np.arange(10.0) / end * (high - low))
        found = forecast(series(true + 0.02 * random.normal(size=10), 0.02))
        assert found is not None
        first, _, last = found.quantiles(found.crossing_s(1.0), SHARES)
        held += first <= end <= last
    assert 48 <= held <= 59, "80 % to 98 % of 60"


def test_what_shrinks_never_reaches_a_limit() -> None:
    found = forecast(series(0.5 - 0.05 * np.arange(6.0), 0.01))
    assert found is not None
    times = found.crossing_s(1.0)
    assert found.share(np.isinf(times)) == pytest.approx(1.0)
    assert math.isinf(found.quantiles(times, (0.5,))[0])


def test_a_limit_that_was_passed_was_passed_before_the_last_recording() -> None:
    found = forecast(series(0.1 * np.arange(1.0, 9.0), 0.01))
    assert found is not None
    assert found.share(found.crossing_s(0.5) < 7.0) > 0.99
    (size,) = found.quantiles(found.sizes_at(4.0), (0.5,))
    assert size == pytest.approx(0.5, abs=0.02)


def test_two_recordings_and_one_time_are_too_little() -> None:
    assert forecast(series(np.array([0.1, 0.2]), 0.01)) is None
    once = SizeSeries.of([1.0] * 3, [0.1, 0.2, 0.3], [SizeError(0.01)] * 3)
    assert forecast(once) is None
