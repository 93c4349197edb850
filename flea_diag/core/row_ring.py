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

"""Ring buffer of the last rows of a stream, with the rows that leave each window."""

from __future__ import annotations

from collections.abc import Sequence
from copy import copy
from typing import Any

import numpy as np
import numpy.typing as npt

ROOM = 4
"""Capacity in longest windows, before the last one is moved to the front."""


class RowRing:
    """Constant memory; zeros before the first row.

    ``most`` is the largest number of rows per push.
    """

    def __init__(self, columns: int, windows: Sequence[int], dtype: type = float) -> None:
        self.size = max(windows)
        self.most = (ROOM - 1) * self.size
        self.store: npt.NDArray[Any] = np.zeros((ROOM * self.size, columns), dtype=dtype)
        self.end = np.array([self.size])
        """Row behind the last one, in an array: compiled loops move it, too."""
        self._leaving = np.arange(self.most)[:, None] - np.array(windows)

    def __deepcopy__(self, memo: object) -> RowRing:
        """With the rows that may still leave a window: what lies before them is room."""
        made = copy(self)
        made.store = np.empty_like(self.store)
        made.store[: self.size] = self.last(self.size)
        made.end = np.array([self.size])
        return made

    def push(self, rows: npt.NDArray[Any]) -> npt.NDArray[Any]:
        """Take rows, shape (n, columns); those that leave, shape (n, windows, columns)."""
        count = len(rows)
        start = self.place(count)
        self.store[start : start + count] = rows
        leaving: npt.NDArray[Any] = self.store[self._leaving[:count] + start]
        return leaving

    def place(self, count: int) -> int:
        """Make room for new rows; returns their place in ``store``."""
        start = int(self.end[0])
        if start + count > len(self.store):
            self.store[: self.size] = self.store[start - self.size : start]
            start = self.size
        self.end[0] = start + count
        return start

    def last(self, count: int) -> npt.NDArray[Any]:
        """The last rows themselves, not a copy."""
        end = self.end.item()
        return self.store[end - count : end]


def place_loops(store: Any, end: npt.NDArray[np.int64], size: int) -> int:
    """``RowRing.place`` of one row, for compiled loops; its place in the store.

    Number by number: into an assignment of a row numba compiles the words of an error of shapes.
    """
    at: int = end[0]
    if at == len(store):
        for k in range(size):
            for c in range(store.shape[1]):
                store[k, c] = store[at - size + k, c]
        at = size
    end[0] = at + 1
    return at
