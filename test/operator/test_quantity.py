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

"""Numbers of the screens: units, and digits that mean something."""

from __future__ import annotations

import datetime
import math

import pytest

from flea_diag.operator.panel import date
from flea_diag.operator.quantity import number, statistic
from flea_diag.wire.records import NEVER_NS


@pytest.mark.parametrize(
    ("value", "unit", "sigma", "text"),
    [
        (59.966, "N", 6.7035, "60.0 ± 6.7 N"),
        (0.9, "1", 0.0, "0.9"),
        (0.9, "1", 1e-9, "0.9"),
        (1.5, "A", math.nan, "1.5 A"),
        (1234.5, "N", math.nan, "1234 N"),
        (-0.0, "N", math.nan, "0 N"),
        (2.34567e-6, "m", 3e-8, "2.35e-06 ± 3e-08 m"),
        (math.nan, "N", math.nan, "unknown"),
        (5.0, "K", math.inf, "5 K"),
    ],
)
def test_a_number_has_the_digits_that_it_is_known_to(
    value: float, unit: str, sigma: float, text: str
) -> None:
    assert number(value, unit, sigma) == text


@pytest.mark.parametrize(
    ("name", "z", "limit", "text"),
    [
        ("parity_mechanical", 7.3071, 6.7438, "z = 7.31, limit 6.74"),
        ("parity_mechanical", 4.7e-16, 6.7438, "z = 0, limit 6.74"),
        ("parity_mechanical", -1e-9, 6.0, "z = 0, limit 6"),
        ("motor_current_stuck", 51.0, 50.0, "51 readings held, limit 50"),
        ("motor_current_dropout", 2.0, 1.5, "2 drop-outs, limit 1"),
        ("load_position", 1.25, 1.0, "125% of its limit"),
        ("parity_mechanical", math.nan, math.nan, "z = unknown, limit unknown"),
    ],
)
def test_a_statistic_is_what_it_counts(name: str, z: float, limit: float, text: str) -> None:
    assert statistic(name, z, limit) == text


def test_the_day_is_that_of_the_calendar() -> None:
    days = [0, 58, 59, 364, 365, 789, 790, 11016, 11017, 19675, 19782, 20000, 47541]
    for day in (*days, *range(0, 40_000, 37)):
        known = (datetime.date(1970, 1, 1) + datetime.timedelta(days=day)).isoformat()
        assert date(day * 86400 * 10**9 + 5) == known
    assert date(NEVER_NS) == ""
