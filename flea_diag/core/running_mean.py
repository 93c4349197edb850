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

"""Running means over the last valid samples, for several window lengths at once."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from flea_diag.core.row_ring import RowRing

Array = npt.NDArray[np.float64]
Counts = npt.NDArray[np.int64]
Flags = npt.NDArray[np.bool_]


class WindowedMeans:
    """Means of each column over its last 1..n valid rows.

    A window that holds a NaN has no mean. Rows come one by one or in blocks; sums
    accumulate in the same order, so a block gives the same bits as its rows one by one. Memory
    is constant. Sums are recomputed once per lap (of the longest window), so that rounding errors
    do not accumulate over a day.
    """

    def __init__(self, columns: int, windows: Sequence[int]) -> None:
        self.windows = tuple(windows)
        self._size = max(self.windows)
        self._lengths = np.array(self.windows)
        self._divisors = self._lengths[:, None].astype(float)
        self._rows = RowRing(columns, windows)
        self._valid = RowRing(columns, self.windows, bool)
        self._sums = np.zeros((len(self.windows), columns))
        self._run = np.zeros(columns, dtype=np.int64)
        self._full_for = 0
        self._lap = 0

    def push(self, rows: Array) -> Array:
        """Take rows, shape (n, columns); the means after each, shape (n, windows, columns).

        NaN until a window holds its full count of valid samples.
        """
        if self._lap + len(rows) <= self._size:
            return self._push(rows)
        cuts = range(self._size - self._lap, len(rows), self._size)
        return np.concatenate([self._push(part) for part in np.split(rows, cuts)])

    def _push(self, rows: Array) -> Array:
        """Take rows of one lap."""
        valid = np.isfinite(rows)
        whole = bool(valid.all())
        clean = rows if whole else np.where(valid, rows, 0.0)
        self._valid.push(valid)
        sums = clean[:, None, :] - self._rows.push(clean)
        sums[0] += self._sums
        if len(rows) > 1:
            np.cumsum(sums, axis=0, out=sums)
        self._lap = (self._lap + len(rows)) % self._size
        if self._lap == 0:
            sums[-1] = self._formed_anew()
        self._sums = sums[-1].copy()
        means: Array = sums / self._divisors
        # Every window has been full for long, and nothing is missing now: no need to look.
        if not whole or self._full_for < self._size:
            means[self._runs(valid)[:, None, :] < self._lengths[:, None]] = np.nan
            self._full_for = int(self._run.min(initial=self._size))
        else:
            self._run += len(rows)
        return means

    def room(self, count: int) -> tuple[tuple[Array, Flags, Array], int, int, Counts]:
        """Memory in which ``z_test_loops`` puts so many rows, no more than the longest window.

        Stores of values and of validity, and the sums; where in them the rows begin; rows of
        this lap until now; how many rows in a row were valid.
        """
        start, lap = self._rows.place(count), self._lap
        self._valid.place(count)
        self._lap = (lap + count) % self._size
        self._full_for = 0
        return (self._rows.store, self._valid.store, self._sums), start, lap, self._run

    def _runs(self, valid: npt.NDArray[np.bool_]) -> npt.NDArray[np.int64]:
        """How many rows in a row were valid, after each row; shape (n, columns)."""
        number = np.arange(1, len(valid) + 1)[:, None]
        runs = self._run + number
        if not valid.all():
            last = np.maximum.accumulate(np.where(valid, 0, number), axis=0)
            runs = np.where(last == 0, runs, number - last)
        self._run = runs[-1]
        return runs

    def _formed_anew(self) -> Array:
        """Sums from the rows themselves."""
        return np.stack([self._rows.last(window).sum(axis=0) for window in self.windows])

    def combine(self, column: int, others: slice, weights: Array) -> None:
        """Add a weighted sum of other columns to one, in every row that it is valid in."""
        rows, valid = self._rows.last(self._size), self._valid.last(self._size)
        change = np.zeros(self._size)
        for values, weight in zip(rows[:, others].T, weights, strict=True):
            change += values * weight
        rows[:, column] += change * valid[:, column]
        self._sums = self._formed_anew()

    def means(self) -> Array:
        """Means as they are now, shape (windows, columns)."""
        full = self._run >= self._lengths[:, None]
        return np.where(full, self._sums / self._divisors, np.nan)

    def clear(self, columns: Sequence[int] | None = None) -> None:
        """Forget all columns, or only some (a channel that turned out to be bad)."""
        which = slice(None) if columns is None else list(columns)
        for store in (self._rows.last(self._size), self._valid.last(self._size), self._sums):
            store[:, which] = 0
        self._run[which] = 0
        self._full_for = 0


def summed_in_order(values: Array) -> Array:
    """Sums over the last axis, in the order of a loop; numpy's own add eight at once."""
    sums: Array = np.add.accumulate(values, axis=-1)[..., -1]
    return sums
