"""Floods of alarms, counted in any ten minutes."""

from __future__ import annotations

from flea_diag.operator.alarm_rate import most_in_a_window, rate_text

MINUTE = 60 * 10**9


def test_the_fullest_ten_minutes_count_wherever_they_begin() -> None:
    assert most_in_a_window([]) == 0
    assert most_in_a_window([0, 9 * MINUTE, 10 * MINUTE, 18 * MINUTE]) == 3
    assert most_in_a_window([10 * MINUTE, 0]) == 1  # ten minutes apart is not within ten minutes


def test_more_than_ten_are_a_flood() -> None:
    assert rate_text([MINUTE] * 10) == "at most 10 alarms within 10 min"
    assert rate_text([MINUTE] * 11).endswith("11 alarms within 10 min: a flood, above 10")
    assert "500 alarms" in rate_text(range(0, MINUTE, MINUTE // 500))
