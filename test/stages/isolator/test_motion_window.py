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

"""What the last window of motion holds: speed, its fastest window, reversals."""

from __future__ import annotations

import math

import pytest
from support.motion_windows import S, motion, moved

from flea_diag.stages.isolator.motion_window import MotionWindow


def test_the_fastest_window_is_a_whole_one_since_then() -> None:
    path = moved(80.0, 20.0, 40.0, math.nan)
    assert path.fastest_rad_s(9 * S) == pytest.approx(80.0, rel=0.01)
    assert path.fastest_rad_s(11 * S) == pytest.approx(40.0, rel=0.01)
    assert path.fastest_rad_s(13 * S) == 0.0
    assert MotionWindow(S).fastest_rad_s(0) == 0.0


@pytest.mark.parametrize(
    ("speeds", "moving"),
    [([0.0] * 100, False), ([30.0] * 100, True), ([math.nan] * 100, True), ([], True),
     ([60.0] * 100 + [0.0] * 100, False), ([0.0] * 90 + [60.0] * 10, True)],
)  # fmt: skip
def test_the_last_window_moved_or_not(speeds: list[float], moving: bool) -> None:
    last = MotionWindow(S)
    for number, speed in enumerate(speeds):
        last.add(number * S // 100, speed, 0.0)
    assert last.reaches(15.0) is moving


@pytest.mark.parametrize(
    ("scans", "turns"),
    [([(30.0, 9.0), (-30.0, 9.0)], True), ([(30.0, 9.0), (-1.0, 9.0)], False),
     ([(30.0, 9.0), (30.0, -9.0)], True), ([(30.0, 9.0), (30.0, -4.0)], False),
     ([(math.nan, math.nan)], False), ([], False)],
)  # fmt: skip
def test_the_last_window_holds_a_reversal_of_motion_or_load(
    scans: list[tuple[float, float]], turns: bool
) -> None:
    assert motion(*scans).reverses is turns
