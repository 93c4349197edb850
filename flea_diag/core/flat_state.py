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

"""Tables of one stop in two flat arrays: compiled loops are handed two, however many it has.

Each array that numba is handed costs a quarter of a microsecond, which a scan alone pays for all.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]
Counts = npt.NDArray[np.int64]
Flat = tuple[Array, Counts]
"""Numbers, and whole numbers: first start, rows and columns of every table, then their own."""


class FlatState:
    """Tables by name; loops see two axes, a vector or a number as one row.

    ``numbers`` and ``counts`` are what they hold at first. ``table`` is a view: what is written
    into it is in the flat arrays. Compiled loops find a table by its place, numbers first
    (``numbers_of``, ``counts_of``).
    """

    def __init__(self, numbers: Mapping[str, Any], counts: Mapping[str, Any]) -> None:
        floats = {name: np.array(table, dtype=np.float64) for name, table in numbers.items()}
        whole = {name: np.array(table, dtype=np.int64) for name, table in counts.items()}
        self._shapes = {name: table.shape for name, table in (*floats.items(), *whole.items())}
        self._numbers = len(floats)
        header, starts = [], [0, 3 * len(self._shapes)]
        for tables, which in ((floats, 0), (whole, 1)):
            for table in tables.values():
                rows = len(table) if table.ndim > 1 else 1
                header += [starts[which], rows, table.size // max(rows, 1)]
                starts[which] += table.size
        parts = [np.array(header, dtype=np.int64), *(table.ravel() for table in whole.values())]
        values = [np.empty(0), *(table.ravel() for table in floats.values())]
        self.flat: Flat = np.concatenate(values), np.concatenate(parts)
        self._carve()

    def _carve(self) -> None:
        """Views of the flat arrays."""
        self.table: dict[str, npt.NDArray[Any]] = {}
        for place, (name, shape) in enumerate(self._shapes.items()):
            start, rows, columns = self.flat[1][3 * place : 3 * place + 3].tolist()
            held = self.flat[place >= self._numbers][start : start + rows * columns]
            self.table[name] = held.reshape(shape)

    def __deepcopy__(self, memo: object) -> FlatState:
        """With views of its own arrays."""
        made = FlatState.__new__(FlatState)
        made._shapes, made._numbers = self._shapes, self._numbers
        made.flat = self.flat[0].copy(), self.flat[1].copy()
        made._carve()
        return made


def numbers_of(flat: Flat, place: int) -> Array:
    """A table of numbers in compiled loops: rows, and all other axes as columns."""
    start, rows, columns = flat[1][3 * place], flat[1][3 * place + 1], flat[1][3 * place + 2]
    return flat[0][start : start + rows * columns].reshape(rows, columns)


def counts_of(flat: Flat, place: int) -> Counts:
    """A table of whole numbers in compiled loops."""
    start, rows, columns = flat[1][3 * place], flat[1][3 * place + 1], flat[1][3 * place + 2]
    return flat[1][start : start + rows * columns].reshape(rows, columns)


FLAT = (numbers_of, counts_of)
"""What loops that are handed flat tables call."""
