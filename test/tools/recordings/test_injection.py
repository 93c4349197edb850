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

"""Faults put into recordings: what each mode makes of a reading, and what the seeds decide."""

from __future__ import annotations

import math

import numpy as np
import pytest

from flea_diag.errors import ConfigurationError
from flea_diag.tools.recordings.injection import (
    CLEAR_S,
    GAP_S,
    MODES,
    ROWS,
    ChannelFault,
    draw,
    faulted,
    inject,
    onsets,
    row_of,
)
from flea_diag.wire.records import Scan

TIMES_S = np.arange(3000) / 100.0
TRUE = 2.0 + np.sin(TIMES_S)
ONSET = 1000


def reading(mode: str, size: float, seed: int = 7) -> np.ndarray:
    return faulted(TRUE, TIMES_S, ChannelFault("motor_current", mode, size, 10.0, seed))


@pytest.mark.parametrize("mode", MODES)
def test_nothing_changes_before_the_onset(mode: str) -> None:
    found = reading(mode, 1.5)
    assert np.array_equal(found[:ONSET], TRUE[:ONSET])
    assert not np.array_equal(found[ONSET:], TRUE[ONSET:])


@pytest.mark.parametrize(
    ("mode", "size", "after_5_s"),
    [
        ("bias", -0.5, TRUE[1500] - 0.5),
        ("drift", 0.1, TRUE[1500] + 0.5),
        ("scaling", 0.8, TRUE[1500] * 0.8),
        ("dead", 0.0, 0.0),
        ("stuck", 0.0, TRUE[ONSET]),
    ],
)
def test_reading_five_seconds_after_the_onset(mode: str, size: float, after_5_s: float) -> None:
    assert reading(mode, size)[1500] == pytest.approx(after_5_s, abs=1e-12)


def test_noise_has_the_stated_deviation_and_no_mean() -> None:
    added = (reading("noise", 0.3) - TRUE)[ONSET:]
    assert added.std() == pytest.approx(0.3, rel=0.06)
    assert abs(added.mean()) < 4 * 0.3 / math.sqrt(len(added))


def test_a_dropout_reads_zero_in_gaps_of_fifty_milliseconds() -> None:
    gone = reading("dropout", 2.0)[ONSET:] == 0.0
    edges = np.flatnonzero(np.diff(np.concatenate(([0], gone, [0]))))
    lengths = np.diff(edges)[::2] / 100.0
    assert np.allclose(np.mod(lengths + 1e-9, GAP_S), 0.0, atol=1e-6)
    # 20 s at 2 gaps a second: a binomial count of 400 slots with p = 0.1.
    assert gone.sum() / 5 == pytest.approx(40, abs=4 * math.sqrt(40 * 0.9))


def test_what_is_not_measured_stays_so_and_the_range_holds() -> None:
    values = TRUE.copy()
    values[2000:2010] = np.nan
    found = faulted(values, TIMES_S, ChannelFault("x", "bias", 5.0, 10.0), high=6.5)
    assert np.isnan(found[2000:2010]).all()
    assert np.nanmax(found) == 6.5


def test_scans_change_in_the_one_channel_alone() -> None:
    channels = ("motor_current", "load_force")
    scans = [Scan(k * 10_000_000, channels, (1.0, 5.0)) for k in range(100)]
    scans[60] = Scan(600_000_000, ("load_force",), (5.0,))
    found = inject(scans, ChannelFault("motor_current", "bias", 0.5, 0.5))
    assert [scan.stamp_ns for scan in found] == [scan.stamp_ns for scan in scans]
    assert found[49] == scans[49]
    assert found[50].values == (1.5, 5.0)
    assert found[60] == scans[60]


def test_unknown_channel_and_mode_are_named() -> None:
    scans = [Scan(0, ("motor_current",), (1.0,))]
    with pytest.raises(ConfigurationError, match="motor_speed"):
        inject(scans, ChannelFault("motor_speed", "bias", 1.0, 0.0))
    with pytest.raises(ConfigurationError, match="wobble"):
        inject(scans, ChannelFault("motor_current", "wobble", 1.0, 0.0))
    with pytest.raises(ConfigurationError, match="motor_current bias"):
        row_of("nut_temperature", "bias")


def test_onsets_are_in_motion_and_away_from_the_ends() -> None:
    resting = np.where((TIMES_S > 12.0) & (TIMES_S < 15.0), 0.0, 0.05 * TIMES_S)
    found = onsets(TIMES_S, resting)
    assert found.min() >= CLEAR_S
    assert found.max() <= TIMES_S[-1] - CLEAR_S
    assert not ((found > 12.2) & (found < 14.8)).any()
    assert ((found > 9.0) & (found < 11.0)).any()
    with pytest.raises(ConfigurationError, match="no onset is possible"):
        draw(ROWS[0], onsets(TIMES_S, 0.0 * TIMES_S), 1, 0)


@pytest.mark.parametrize("row", ROWS, ids=lambda row: f"{row.channel}_{row.mode}")
def test_cases_lie_within_the_row_and_repeat_by_seed(row) -> None:
    candidates = onsets(TIMES_S, 0.05 * TIMES_S)
    cases = [draw(row, candidates, 11, case) for case in range(200)]
    assert cases == [draw(row, candidates, 11, case) for case in range(200)]
    assert cases[0] != draw(row, candidates, 12, 0)
    strengths = np.abs(np.array([case.size for case in cases]) - (row.mode == "scaling"))
    assert strengths.min() >= row.low - 1e-12
    assert strengths.max() <= row.high + 1e-12
    if row.mode in ("bias", "drift"):
        assert 60 < sum(case.size > 0 for case in cases) < 140
    assert row.low in row.ladder
    assert draw(row, candidates, 11, 3, severity=row.ladder[0]).onset_s == cases[3].onset_s
