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

from flea_diag.core.flat_state import Flat, FlatState
from flea_diag.core.row_ring import RowRing

Array = npt.NDArray[np.float64]
Counts = npt.NDArray[np.int64]
Flags = npt.NDArray[np.bool_]
Memory = tuple[tuple[Array, Flags], tuple[Counts, Counts], Flat]
"""Stores of values and of validity, where the rows of both end, and the tables of ``MEANS``."""
MEANS = SUMS, LENGTHS, LAP, RUN, GAP, LONGEST, SEEN = range(7)
"""Sums of each window; lengths of the windows, and rows of this lap; of each column how long its
window and its gap are, the longest gap, and how many rows each window has seen."""


class WindowedMeans:
    """Means of each column over what is valid of its last 1..n rows.

    A gap of more than ``longest_gap`` rows, a number for each column or one for all, ends a window:
    from there on it has no mean until it is full again, nor where less than half of it is valid.
    Within a gap there is none either: what is left then is the end of what was valid.
    Rows come one by one or in blocks; sums accumulate in the same order, so a block gives the same
    bits as its rows one by one. Memory is constant. Sums are recomputed once per lap (of the
    longest window), so that rounding errors do not accumulate over a day.
    """

    def __init__(self, columns: int, windows: Sequence[int], longest_gap: int | Counts = 0) -> None:
        self.windows = tuple(windows)
        self._size = max(self.windows)
        self._lengths = np.array(self.windows)
        self._divisors = self._lengths[:, None].astype(float)
        self._rows = RowRing(columns, windows)
        self._valid = RowRing(columns, self.windows, bool)
        longest: Counts = np.broadcast_to(longest_gap, columns).astype(np.int64)
        none = np.zeros((len(self.windows), columns))
        self._state = FlatState(
            {"sums": none},
            {
                "lengths": self._lengths, "lap": 0, "run": np.zeros(columns), "gap": longest + 1,
                "longest": longest, "seen": none,
            },
        )  # fmt: skip
        self._whole_for = 0

    def push(self, rows: Array) -> Array:
        """Take rows, shape (n, columns); the means after each, shape (n, windows, columns).

        NaN until a window is as long as it should be.
        """
        lap = self._state.table["lap"].item()
        if lap + len(rows) <= self._size:
            return self._push(rows)
        cuts = range(self._size - lap, len(rows), self._size)
        return np.concatenate([self._push(part) for part in np.split(rows, cuts)])

    def _push(self, rows: Array) -> Array:
        """Take rows of one lap."""
        valid = np.isfinite(rows)
        whole = bool(valid.all())
        clean = rows if whole else np.where(valid, rows, 0.0)
        left = self._valid.push(valid)
        sums, held = clean[:, None, :] - self._rows.push(clean), self._state.table
        sums[0] += held["sums"]
        if len(rows) > 1:
            np.cumsum(sums, axis=0, out=sums)
        held["lap"][...] = (held["lap"].item() + len(rows)) % self._size
        if not held["lap"].item():
            sums[-1] = self._formed_anew()
        held["sums"][:] = sums[-1]
        # Nothing has been missing for long, and nothing is now: no need to look.
        if whole and self._whole_for >= self._size:
            held["run"] += len(rows)
            means: Array = sums / self._divisors
            return means
        seen = valid[:, None, :].astype(np.int64) - left
        seen[0] += held["seen"]
        seen = np.cumsum(seen, axis=0)
        held["seen"][:] = seen[-1]
        bad = np.flatnonzero(~valid.all(axis=1))
        self._whole_for = len(rows) - 1 - int(bad[-1]) if len(bad) else self._whole_for + len(rows)
        runs, lengths = np.where(valid, self._runs(valid), 0)[:, None, :], self._lengths[:, None]
        judged = (runs >= lengths) & (2 * seen >= lengths)
        return np.where(judged, sums / np.maximum(seen, 1), np.nan)

    def memory(self) -> Memory:
        """The state, for ``z_test_loops`` to go on with."""
        self._whole_for = 0
        stores = self._rows.store, self._valid.store
        return stores, (self._rows.end, self._valid.end), self._state.flat

    def _runs(self, valid: Flags) -> Counts:
        """How many rows there are since the last gap that was too long, shape (n, columns)."""
        held = self._state.table
        number = np.arange(1, len(valid) + 1)[:, None]
        last = np.maximum.accumulate(np.where(valid, number, 0), axis=0)
        gap = number - last + np.where(last == 0, held["gap"], 0)
        ended = np.maximum.accumulate(np.where(gap > held["longest"], number, 0), axis=0)
        runs: Counts = number - ended + np.where(ended == 0, held["run"], 0)
        held["run"][:], held["gap"][:] = runs[-1], np.minimum(gap[-1], held["longest"] + 1)
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
        self._state.table["sums"][:] = self._formed_anew()

    def clear(self, columns: Sequence[int] | None = None) -> None:
        """Forget all columns, or only some (a channel that turned out to be bad)."""
        which = slice(None) if columns is None else list(columns)
        held = self._state.table
        for store in (self._rows.last(self._size), self._valid.last(self._size), held["sums"]):
            store[:, which] = 0
        held["run"][which], held["gap"][which] = 0, held["longest"][which] + 1
        held["seen"][:, which] = 0
        self._whole_for = 0


def summed_in_order(values: Array) -> Array:
    """Sums over the last axis, in the order of a loop; numpy's own add eight at once."""
    sums: Array = np.add.accumulate(values, axis=-1)[..., -1]
    return sums


def rolling_means(values: Array, window: int) -> Array:
    """Means over ``window`` rows that follow one another, of each column: (n - window + 1, …)."""
    sums = np.concatenate((np.zeros((1, *values.shape[1:])), np.cumsum(values, axis=0)))
    means: Array = (sums[window:] - sums[:-window]) / window
    return means
