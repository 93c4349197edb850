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

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from support import examples

from flea_diag.core.running_mean import WindowedMeans

WINDOWS = (2, 3, 7)
CELLS = st.one_of(st.floats(-1e3, 1e3), st.just(float("nan")), st.just(float("inf")))


def expected(rows: np.ndarray, window: int) -> np.ndarray:
    last = rows[-window:]
    if len(last) < window:
        return np.full(rows.shape[1], np.nan)
    return np.where(np.isfinite(last).all(axis=0), np.where(np.isfinite(last), last, 0).mean(0),
                    np.nan)  # fmt: skip


@settings(max_examples=examples(60))
@given(st.lists(st.tuples(CELLS, CELLS), min_size=1, max_size=40))
def test_means_are_those_of_the_last_rows(rows):
    means = WindowedMeans(2, WINDOWS)
    table = np.array(rows)
    for count, row in enumerate(table, 1):
        for found, window in zip(means.push(row[None])[0], WINDOWS, strict=True):
            np.testing.assert_allclose(found, expected(table[:count], window), atol=1e-9)


def test_short_gaps_are_passed_over_and_long_ones_end_a_window():
    means = WindowedMeans(1, (8,), longest_gap=3)
    rows = np.arange(40.0)[:, None]
    rows[[10, 12, 13], 0] = np.nan
    rows[20:24, 0] = np.nan
    found = means.push(rows)[:, 0, 0]
    judged = set(range(7, 20)) - {10, 12, 13} | set(range(31, 40))
    assert set(np.flatnonzero(np.isfinite(found))) == judged
    assert found[14] == np.mean([7, 8, 9, 11, 14])
    assert np.isnan(WindowedMeans(1, (8,), 3).push(np.where(rows % 4 < 3, np.nan, rows))).all()


def test_no_drift_over_many_laps():
    random = np.random.default_rng(3)
    # A huge value passes through now and then: its rounding must leave with it.
    stream = random.standard_normal(20_000) * np.where(random.random(20_000) < 0.01, 1e12, 1.0)
    stream[-400:] = random.standard_normal(400)
    means = WindowedMeans(1, (50, 100))
    for value in stream:
        (found,) = means.push(np.array([[value]]))
    np.testing.assert_allclose(found[:, 0], [stream[-50:].mean(), stream[-100:].mean()], rtol=1e-12)


@given(st.integers(0, 20), st.floats(-5.0, 5.0))
def test_combine_acts_as_if_the_rows_had_been_so_all_along(later, weight):
    random = np.random.default_rng(later)
    rows = random.standard_normal((9 + later, 3))
    rows[4, 0] = np.nan
    plain, moved = WindowedMeans(3, WINDOWS), WindowedMeans(3, WINDOWS)
    moved.push(rows[:9])
    moved.combine(0, slice(1, 3), np.array([weight, -1.0]))
    change = np.zeros_like(rows)
    change[:9, 0] = weight * rows[:9, 1] - rows[:9, 2]
    plain.push(rows[:9] + change[:9])
    for row in np.concatenate((rows[9:], np.ones((1, 3)))):
        np.testing.assert_allclose(moved.push(row[None]), plain.push(row[None]), atol=1e-12)


def test_clear_forgets_some_columns_or_all():
    means = WindowedMeans(2, (2,))
    for _ in range(5):
        means.push(np.array([[1.0, 2.0]]))
    means.clear([0])
    first, second = means.push(np.array([[5.0, 2.0], [6.0, 2.0]]))[:, 0]
    np.testing.assert_array_equal(first, [np.nan, 2.0])
    assert second.tolist() == [5.5, 2.0]
    means.clear()
    first, second = means.push(np.array([[1.0, 1.0], [3.0, 1.0]]))[:, 0]
    assert np.isnan(first).all()
    assert second.tolist() == pytest.approx([2.0, 1.0])
    means.clear([])
    np.testing.assert_array_equal(means.push(np.array([[3.0, 1.0]]))[0, 0], [3.0, 1.0])


@settings(max_examples=examples(60))
@given(st.lists(st.integers(1, 30), min_size=1, max_size=12), st.integers(0, 1000))
def test_blocks_give_the_bits_of_their_rows(lengths, seed):
    random = np.random.default_rng(seed)
    rows = random.standard_normal((sum(lengths), 3)) * 10.0 ** random.integers(-6, 9, 3)
    rows[random.random(rows.shape) < 0.05] = np.nan
    one, many = WindowedMeans(3, WINDOWS, seed % 3), WindowedMeans(3, WINDOWS, seed % 3)
    single = np.concatenate([one.push(row[None]) for row in rows])
    blocks = np.split(rows, np.cumsum(lengths)[:-1])
    np.testing.assert_array_equal(np.concatenate([many.push(b) for b in blocks]), single)
