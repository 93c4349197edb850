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

"""Floods of alarms, counted in any ten minutes."""

from __future__ import annotations

from flea_diag.operator.shift.alarm_rate import (
    SHIFT_NS,
    floods,
    most_in_a_window,
    of_shift,
    rate_text,
)

MINUTE = 60 * 10**9


def test_the_fullest_ten_minutes_count_wherever_they_begin() -> None:
    assert most_in_a_window([]) == 0
    assert most_in_a_window([0, 9 * MINUTE, 10 * MINUTE, 18 * MINUTE]) == 3
    assert most_in_a_window([10 * MINUTE, 0]) == 1  # ten minutes apart is not within ten minutes


def test_more_than_ten_are_a_flood() -> None:
    assert rate_text([MINUTE] * 10) == "at most 10 alarms within 10 min"
    assert rate_text([MINUTE] * 11).endswith("11 alarms within 10 min: a flood, above 10")
    assert "500 alarms" in rate_text(range(0, MINUTE, MINUTE // 500))


def test_a_flood_lasts_until_there_are_fewer_than_five_in_ten_minutes() -> None:
    """EEMUA 191: begins above ten within ten minutes, ends below five; two floods, one shift."""
    first = [MINUTE + k for k in range(12)]
    rest = [MINUTE * 9 + k for k in range(3)]
    lone = [MINUTE * 40, MINUTE * 41]
    second = [MINUTE * 100 + k * MINUTE // 10 for k in range(20)]
    found = floods([*second, *lone, *rest, *first])
    assert [(f.since_ns, f.until_ns, f.count) for f in found] == [
        (first[0], rest[-1], 15),
        (second[0], second[-1], 20),
    ]
    assert floods([MINUTE * k for k in range(100)]) == ()
    told = rate_text([*first, *rest, *lone, *second])
    assert told == "at most 20 alarms within 10 min: 2 floods, above 10, together 10 min"


def test_a_shift_is_what_came_in_its_hours() -> None:
    assert of_shift([1, SHIFT_NS, SHIFT_NS + 2, 3], SHIFT_NS + 2) == (3, SHIFT_NS, SHIFT_NS + 2)
