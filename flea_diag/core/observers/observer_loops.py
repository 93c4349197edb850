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

"""What goes into and out of ``state_observer.StateObserver``, for numba to compile: the same bits.

``read_loops`` is ``observer_block.Scans.read``, ``join_loops`` is ``Innovations.joined``.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import lru_cache

import numpy as np
import numpy.typing as npt

from flea_diag.core import backend as backends
from flea_diag.core.observers.observer_block import ABSURD, ReadingColumns

Array = npt.NDArray[np.float64]
Counts = npt.NDArray[np.int64]
Flags = npt.NDArray[np.bool_]


COLUMNS = ReadingColumns((), (), -1, ())
"""In place of those of a stand: see ``read_of``."""


def sane_loops(row: Array, column: int) -> float:
    """A reading, NaN where it is none."""
    if column < 0:
        return math.nan
    value: float = row[column]
    return value if abs(value) < ABSURD else math.nan


def read_loops(
    rows: Array, absent: Flags, command: tuple[float, float], driving: Flags,
    scans: tuple[Array, Array, Array, Array], measured: Counts,
) -> None:  # fmt: skip
    """Scan after scan into ``scans``, and how many channels of motion each has measured."""
    u, y, held, degc = scans
    for i in range(len(rows)):
        measured[i] = 0
        for k in range(len(COLUMNS.motion)):
            y[i, k] = math.nan if absent[k] else sane_loops(rows[i], COLUMNS.motion[k])
            held[i, k] = y[i, k] if driving[k] else math.nan
            measured[i] += not math.isnan(y[i, k])
        for k in range(len(COLUMNS.inputs)):
            u[i, k] = sane_loops(rows[i], COLUMNS.inputs[k])
        if math.isnan(u[i, 0]):
            u[i, 0] = command[0] + command[1] * sane_loops(rows[i], COLUMNS.command)
        for k in range(len(COLUMNS.degc)):
            degc[i, k] = sane_loops(rows[i], COLUMNS.degc[k])


def join_loops(
    raw: Array, measured: Counts, table: Array, motion: int, predicted: int, order: Counts
) -> None:
    """Rows of innovations from raw rows; what is in heated stores counts as measured, too."""
    for i in range(len(raw)):
        for k in range(len(order)):
            table[i, k] = raw[i, order[k]]
        total = 0.0
        for k in range(motion, predicted):
            warmth = table[i, predicted + k] / table[i, 2 * predicted + k]
            if not math.isnan(warmth):
                total += warmth * warmth
                measured[i] += 1
        table[i, -2] += total


@lru_cache(maxsize=8)
def read_of(columns: ReadingColumns) -> Callable[..., None]:
    """``read_loops`` of one stand, compiled."""
    loop = backends.bound(read_loops, COLUMNS=columns)
    made: Callable[..., None] = backends.exact(loop, sane_loops)
    return made
