"""Running means over the last samples that counted, for several window lengths at once."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]


class WindowedMeans:
    """Means of each column over its last 1..n valid rows.

    A NaN is no sample: it neither enters a mean nor pushes an older value out of the count
    of valid ones. Memory is constant; sums are formed anew once a lap, so that rounding
    does not creep in over a day.
    """

    def __init__(self, columns: int, windows: Sequence[int]) -> None:
        self.windows = tuple(windows)
        self._size = max(self.windows)
        self._lengths = np.array(self.windows)
        self._rows = np.zeros((self._size, columns))
        self._valid = np.zeros((self._size, columns))
        self._sums = np.zeros((len(self.windows), columns))
        self._counts = np.zeros((len(self.windows), columns))
        self._next = 0

    def push(self, row: Array) -> None:
        """Take one row, shape (columns,)."""
        valid = np.isfinite(row)
        clean = np.where(valid, row, 0.0)
        leaving = (self._next - self._lengths) % self._size
        self._sums += clean - self._rows[leaving]
        self._counts += valid - self._valid[leaving]
        self._rows[self._next] = clean
        self._valid[self._next] = valid
        self._next = (self._next + 1) % self._size
        if self._next == 0:
            self._renew()

    def _renew(self) -> None:
        """Sums from the rows themselves, the newest of which is the one before ``_next``."""
        rows = np.roll(self._rows, -self._next, axis=0)
        for index, window in enumerate(self.windows):
            self._sums[index] = rows[self._size - window :].sum(axis=0)

    def combine(self, column: int, others: slice, weights: Array) -> None:
        """Add a weighted sum of other columns to one, in every row that it is valid in."""
        self._rows[:, column] += (self._rows[:, others] @ weights) * self._valid[:, column]
        self._renew()

    def means(self) -> Array:
        """Shape (windows, columns); NaN until a window holds its full count of valid samples."""
        full = self._counts >= self._lengths[:, None]
        with np.errstate(invalid="ignore", divide="ignore"):
            return np.where(full, self._sums / self._counts, np.nan)

    def clear(self, columns: Sequence[int] | None = None) -> None:
        """Forget all columns, or only some (a channel that turned out to be bad)."""
        which = slice(None) if columns is None else list(columns)
        for store in (self._rows, self._valid, self._sums, self._counts):
            store[:, which] = 0.0
