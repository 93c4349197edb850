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

"""Intervals against published tables, and ladders against hand-worked ones."""

from __future__ import annotations

import pytest
from scipy import stats

from flea_diag.tools.interval import half_point, increasing, rate_interval, wilson


@pytest.mark.parametrize(
    ("right", "count", "low", "high"),
    [(13, 21, 40.9, 79.2), (10, 15, 41.7, 84.8), (15, 15, 79.6, 100.0), (60, 60, 94.0, 100.0)],
)
def test_wilson_gives_what_is_printed(right: int, count: int, low: float, high: float) -> None:
    found = wilson(right, count)
    assert 100.0 * found[0] == pytest.approx(low, abs=0.05)
    assert 100.0 * found[1] == pytest.approx(high, abs=0.05)


def test_wilson_agrees_with_scipy() -> None:
    for right, count in [(0, 7), (3, 7), (7, 7), (133, 134)]:
        other = stats.binomtest(right, count).proportion_ci(0.95, method="wilson")
        assert wilson(right, count) == pytest.approx((other.low, other.high), abs=1e-12)
    assert wilson(0, 0) == (0.0, 1.0)


def test_a_rate_agrees_with_chi_square_quantiles() -> None:
    for events in (0, 1, 4, 25):
        low, high = rate_interval(events, 10.0)
        assert high == pytest.approx(stats.chi2.ppf(0.975, 2 * events + 2) / 20.0)
        assert low == pytest.approx(stats.chi2.ppf(0.025, 2 * events) / 20.0 if events else 0.0)
    assert rate_interval(0, 0.0)[1] == float("inf")


def test_violators_are_pooled_by_weight() -> None:
    assert increasing([0.0, 0.5, 0.2, 1.0], [1, 1, 2, 1]) == pytest.approx([0.0, 0.3, 0.3, 1.0])
    assert increasing([3.0, 2.0, 1.0], [1, 1, 1]) == [2.0, 2.0, 2.0]


def test_half_is_passed_by_a_straight_line() -> None:
    assert half_point([1.0, 2.0, 4.0], [0.0, 0.25, 0.75]) == 3.0
    assert half_point([1.0, 2.0], [0.6, 1.0]) is None
    assert half_point([1.0, 2.0], [0.1, 0.4]) is None
