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

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from flea_diag.core.scan_counts import ScanCounts
from flea_diag.core.sensors.reading_jump import ReadingJumps

AT_100_HZ = ScanCounts(0.01)


def largest(readings: np.ndarray, counts: ScanCounts = AT_100_HZ) -> float:
    found = ReadingJumps([0], counts).step(readings[:, None])
    return float(np.nanmax(np.abs(found)))


def stepped(before: int = 20, scans: int = 60, size: float = 5.0) -> np.ndarray:
    return np.where(np.arange(scans) < before, 0.0, size)


def test_a_step_is_a_jump_of_its_size():
    assert largest(stepped()) == 5.0


def test_so_is_one_that_falls_within_the_mean_of_a_scan():
    readings = stepped()
    readings[20] = 2.5
    assert largest(readings) == 5.0


def test_at_a_high_rate_an_instrument_may_take_some_scans_for_it():
    slow = np.interp(np.arange(60), [20, 30], [0.0, 5.0])
    assert largest(slow, ScanCounts(0.001)) == 5.0
    assert largest(slow) == pytest.approx(1.0)


def test_the_first_reading_is_no_jump_and_a_missing_one_is_unknown():
    readings = np.array([[9.0], [9.0], [np.nan], [9.0], [9.0], [9.0]])
    found = ReadingJumps([0], AT_100_HZ).step(readings)[:, 0]
    np.testing.assert_array_equal(found, [0.0, 0.0, np.nan, 0.0, np.nan, 0.0])


@given(st.lists(st.integers(1, 59), max_size=5), st.sets(st.integers(0, 59), max_size=20))
def test_blocks_of_any_size_give_the_same_jumps(cuts, missing):
    rows = np.random.default_rng(1).standard_normal((60, 2))
    rows[sorted(missing), 1] = np.nan
    whole, parted = ReadingJumps([1, 0], AT_100_HZ), ReadingJumps([1, 0], AT_100_HZ)
    ends = [0, *sorted(set(cuts)), 60]
    parts = [parted.step(rows[a:b]) for a, b in pairwise(ends)]
    np.testing.assert_array_equal(whole.step(rows), np.concatenate(parts))
