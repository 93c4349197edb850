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

import pytest

from flea_diag.core.detection.symbols import SymbolState, crossed, later

S = 1_000_000_000
HALF, FOUR = (50.0, 5.0, 0.0), (400.0, 4.8, 0.0)
"""Tests of one residual: windows of half a second and of four seconds, each with its limit."""


@pytest.mark.parametrize(("z", "magnitude"), [(5.0, "+"), (-5.0, "-"), (0.1, "+")])
def test_the_magnitude_is_the_sign_at_the_crossing(z, magnitude):
    assert crossed(z, HALF, 7) == SymbolState(magnitude, "?", 7, z, HALF)


@pytest.mark.parametrize(
    ("at_crossing", "now", "after_s", "slope"),
    [
        (5.0, 30.0, 1.99, "?"),
        (5.0, 30.0, 2.0, "+"),
        (5.0, -30.0, 2.0, "-"),
        # A difference of two means has sqrt(2) of their sigma, three of those are 4.24.
        (5.0, 9.2, 2.0, "0"),
        (5.0, 9.3, 2.0, "+"),
        (-5.0, -9.3, 3.0, "-"),
        (-5.0, -0.7, 3.0, "+"),
        (5.0, math.nan, 2.0, "?"),
        # A jump of a hundred sigmas that wanders by a fifth has not risen.
        (100.0, 120.0, 2.0, "0"),
        (-100.0, -70.0, 2.0, "+"),
    ],
)
def test_the_slope_is_decided_later(at_crossing, now, after_s, slope):
    state = later(crossed(at_crossing, HALF, 10 * S), now, HALF, round((10 + after_s) * S))
    assert state.slope == slope
    assert (state.magnitude, state.since_ns) == ("+" if at_crossing > 0 else "-", 10 * S)


def test_a_slope_once_decided_stays():
    state = later(crossed(5.0, HALF, 0), 30.0, HALF, 2 * S)
    assert later(state, -90.0, HALF, 9 * S) is state


def test_sigmas_of_another_test_say_nothing_of_the_slope():
    # A step of 3 units: 6 sigmas of a mean over half a second, 20 of one over four. It stays.
    state = later(crossed(3.0 / 0.5, HALF, 0), 3.0 / 0.15, FOUR, 2 * S)
    assert state.slope == "?"
    assert later(state, 3.0 / 0.5, HALF, 3 * S).slope == "0"


@pytest.mark.parametrize("now", [1.0, math.nan])
def test_nor_does_a_mean_of_another_direction_of_motion(now):
    out, other = (50.0, 5.0, -1.0), (50.0, 5.0, now)
    assert later(crossed(13.0, out, 0), 6.0, other, 2 * S).slope == "?"
    assert later(crossed(13.0, other, 0), 6.0, other, 2 * S).slope == ("?" if now != now else "-")
