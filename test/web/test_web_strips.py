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

"""Strip charts lose no peak, stay as small as they are, and begin anew with a new run."""

from __future__ import annotations

import math

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from flea_diag.configuration.languages import catalogue
from flea_diag.operator.words import speaking
from flea_diag.web.strips import KEPT_NS, PAST_S, STRETCH_NS, Strip, StripCharts
from flea_diag.wire.records import ChannelInfo, ChannelTable, Residual, Scan, VibrationLevel

PERIOD_NS = 10_000_000
EACH = STRETCH_NS["channel"] // PERIOD_NS
START_NS = 1_700_000_000 * 10**9


def scan(k: int, *values: float, names: tuple[str, ...] = ("a", "b")) -> Scan:
    return Scan(START_NS + k * PERIOD_NS, names, values)


@given(st.lists(st.floats(-1e6, 1e6), min_size=3 * EACH, max_size=8 * EACH))
def test_each_stretch_has_the_least_and_the_largest_of_its_samples(values: list[float]) -> None:
    charts = StripCharts()
    for k, value in enumerate(values):
        charts.take(scan(k, value, -value))
    rows = charts.after("channel", -1)
    whole = len(values) // EACH
    assert len(rows) >= whole - 1
    for k, (stretch, row) in enumerate(rows):
        part = np.array(values[k * EACH : (k + 1) * EACH])
        assert stretch == START_NS // STRETCH_NS["channel"] + k
        expected = [part.min(), part.max(), (-part).min(), (-part).max()]
        np.testing.assert_allclose(row[:4], expected, rtol=1e-4, atol=1e-300)


def test_only_new_rows_are_given_and_only_a_minute_is_kept() -> None:
    charts = StripCharts()
    for k in range(2 * KEPT_NS // PERIOD_NS):
        charts.take(scan(k, 1.0, 2.0))
    rows = charts.after("channel", -1)
    minute, second = KEPT_NS // STRETCH_NS["channel"], 10**9 // STRETCH_NS["channel"]
    assert minute <= len(rows) < minute + second
    assert [row[0] for row in charts.after("channel", rows[-3][0])] == [rows[-2][0], rows[-1][0]]


def test_a_value_that_is_missing_is_said_so_and_hides_no_other() -> None:
    charts = StripCharts()
    for k in range(2 * EACH + 1):
        charts.take(scan(k, math.nan, math.nan if k % 2 else 5.0))
    assert charts.after("channel", -1)[0][1][:4] == [None, None, 5.0, 5.0]


def test_estimates_and_limits_go_with_their_charts() -> None:
    charts = StripCharts()
    charts.take(ChannelTable(0, "stand", (ChannelInfo("b", "A", -1.0, 1.0, 100.0),)))
    for k in range(3 * EACH):
        stamp_ns = START_NS + k * PERIOD_NS
        charts.take(
            Residual(
                stamp_ns, ("r",), (0.1,), (2.0,), (5.5,), estimated=("b",), estimates=(7.0,),
                estimate_sigmas=(0.5,),
            )
        )  # fmt: skip
        charts.take(scan(k, 1.0, 2.0))
    a, b = charts.description("channel")
    row = charts.after("channel", -1)[-1][1]
    assert (row[b["estimate"]], row[b["sigma"]], row[a["estimate"]]) == (7.0, 0.5, None)
    assert (a["unit"], b["unit"]) == ("", "A")
    (r,) = charts.description("residual")
    row = charts.after("residual", -1)[-1][1]
    assert (row[r["low"]], row[r["high"]], row[r["limit"]]) == (2.0, 2.0, 5.5)


def test_units_of_statistics_are_in_the_language_of_the_reader() -> None:
    charts, names = StripCharts(), ("load_force", "motor_current_stuck", "load_position")
    with speaking(*catalogue("de")):
        charts.take(Residual(START_NS, names, (0.0,) * 3, (0.0,) * 3, (5.0, 50.0, 1.0)))
        units = [chart["unit"] for chart in charts.description("residual")]
    assert units == ["σ", "gleiche Messwerte", "seiner Grenze"]


def test_a_new_run_and_other_channels_begin_anew() -> None:
    charts = StripCharts()
    for k in range(500, 500 + 3 * EACH):
        charts.take(scan(k, 1.0, 2.0))
    before = charts.generation
    charts.take(scan(500, 1.0, 2.0))  # a little late: passed over
    assert charts.generation == before
    charts.take(scan(0, 1.0, 2.0))
    assert charts.generation == before + 1
    assert charts.after("channel", -1) == []
    charts.take(scan(1, 1.0, names=("a",)))
    assert charts.generation == before + 2


def test_vibration_shows_what_the_monitor_tests() -> None:
    charts = StripCharts()
    charts.take(VibrationLevel(START_NS, ("x", "y"), (0.1, 0.2), (3.0, 9.0)))
    charts.take(VibrationLevel(START_NS + STRETCH_NS["vibration"], ("x", "y"), (0.1, 0.2), (3, 3)))
    names = [chart["name"] for chart in charts.description("vibration")]
    assert names == ["x", "y", "x kurtosis", "y kurtosis"]
    ((_, row),) = charts.after("vibration", -1)
    assert row == [0.1, 0.1, 0.2, 0.2, 3.0, 3.0, 9.0, 9.0]


def test_ten_minutes_are_kept_in_bounded_memory_and_no_peak_is_lost() -> None:
    """As ranges of a second before the last minute; a peak stands in its own second."""
    strip, many = Strip(("r",), STRETCH_NS["residual"]), 10**9 // STRETCH_NS["residual"]
    peaks = {500: 9.0, 700: -4.0}
    for k in range(1000 * many):
        value = peaks.get(k // many, 0.5) if k % many == 3 else 0.5
        strip.add(k * STRETCH_NS["residual"], (value,), (3.0,))
    past, fine = strip.past(), strip.after(-1)
    assert len(past) == PAST_S
    assert (past[-1][0] + 1) * many == fine[0][0]
    assert [row for row in past if row[1] != [0.5, 0.5, 3.0]] == [
        (500, [0.5, 9.0, 3.0]),
        (700, [-4.0, 0.5, 3.0]),
    ]
