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

"""Rows by their stamps: what is odd is mended with a word, and recordings are cut."""

from __future__ import annotations

import numpy as np
import pytest

from flea_diag.errors import RecordingError
from flea_diag.tools.tables.row_order import RowOrder, row_order

EVEN = 0.01 * np.arange(400)


def ordered(seconds: np.ndarray, values: np.ndarray | None = None) -> RowOrder:
    read = np.sin(seconds) if values is None else values
    return row_order("run.csv", "t", seconds, {"current": read})


def test_even_rows_are_left_as_they_are() -> None:
    found = ordered(EVEN)
    assert (found.parts[0] == np.arange(400)).all()
    assert found.notes == ()
    assert found.period_s == pytest.approx(0.01)


def test_rows_in_no_order_are_sorted() -> None:
    mixed = np.random.default_rng(3).permutation(EVEN)
    found = ordered(mixed)
    assert (np.diff(mixed[found.parts[0]]) > 0.0).all()
    assert "in no order of time: sorted" in found.notes[0]


def test_one_swapped_and_one_repeated_row_are_said() -> None:
    swapped = EVEN.copy()
    swapped[[100, 101]] = swapped[[101, 100]]
    found = ordered(swapped)
    assert found.parts[0].tolist()[99:103] == [99, 101, 100, 102]
    assert found.notes == ("1 row out of order, put in place by time",)
    repeated = np.insert(EVEN, 50, EVEN[50])
    assert ordered(repeated).notes == ("1 row written twice, used once",)
    again = ordered(repeated, np.arange(401.0))
    assert again.notes == ("1 row with the time of the row before left out",)
    assert len(again.parts[0]) == 400


def test_a_recording_that_begins_anew_is_cut() -> None:
    found = ordered(np.concatenate([EVEN, EVEN]))
    assert [part.tolist() for part in found.parts] == [
        list(range(400)), list(range(400, 800)),
    ]  # fmt: skip
    assert found.notes == ("its times begin anew 1 times: 2 recordings",)


def test_a_coarse_clock_is_spread_over_its_rows() -> None:
    found = ordered(np.floor(EVEN * 10.0) / 10.0, np.arange(400.0))
    np.testing.assert_allclose(found.seconds, EVEN, atol=1e-9)
    assert "10 rows share a stamp" in found.notes[0]


def test_gaps_and_jitter_are_said() -> None:
    assert ordered(np.delete(EVEN, slice(100, 250))).notes == (
        "1 gap between rows, the longest of 1.51 s",
    )
    uneven = np.cumsum(np.random.default_rng(1).choice([0.001, 0.03, 0.35], 400))
    assert "rows come 1 to 350 ms apart, 30 ms in the middle" in ordered(uneven).notes[0]


@pytest.mark.parametrize(
    ("seconds", "words"),
    [
        (np.zeros(50), "'t' is 0 in all 50 rows: the clock stood still"),
        (np.where(np.arange(50) % 5, 0.01 * np.arange(50), np.nan), "10 of 50 rows have no t"),
    ],
)
def test_times_that_are_none_are_refused(seconds: np.ndarray, words: str) -> None:
    with pytest.raises(RecordingError, match=words):
        ordered(seconds)
