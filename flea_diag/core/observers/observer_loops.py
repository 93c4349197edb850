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

"""``state_observer.StateObserver`` with the particle filter as one compiled call.

``read_loops`` is ``observer_block.Scans.read``, ``join_loops`` is ``Innovations.joined``.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import lru_cache
from typing import Any

import numpy as np
import numpy.typing as npt

from flea_diag.core import backend as backends
from flea_diag.core.observers.driven_model import track_of
from flea_diag.core.observers.motion_step import MotionCoefficients
from flea_diag.core.observers.normal_table import Indices
from flea_diag.core.observers.observer_block import ABSURD, ReadingColumns
from flea_diag.core.observers.track_loops import track_loops
from flea_diag.core.residuals.driven_equations import DrivenEquations

Array = npt.NDArray[np.float64]
Counts = npt.NDArray[np.int64]
Flags = npt.NDArray[np.bool_]


COLUMNS = ReadingColumns((), (), -1, ())
ABSENT, DRIVING, LAYOUT = (), (), (0, 0, 0)
"""In place of those of a stand: see ``observe_of``."""


def sane_loops(row: Array, column: int) -> float:
    """A reading, NaN where it is none."""
    if column < 0:
        return math.nan
    value: float = row[column]
    return value if abs(value) < ABSURD else math.nan


def read_loops(
    rows: Array, command: tuple[float, float], scans: tuple[Array, Array, Array, Array],
    measured: Counts,
) -> None:  # fmt: skip
    """Scan after scan into ``scans``, and how many channels of motion each has measured."""
    u, y, held, degc = scans
    for i in range(len(rows)):
        measured[i] = 0
        for k in range(len(COLUMNS.motion)):
            y[i, k] = math.nan if ABSENT[k] else sane_loops(rows[i], COLUMNS.motion[k])
            held[i, k] = y[i, k] if DRIVING[k] else math.nan
            measured[i] += not math.isnan(y[i, k])
        for k in range(len(COLUMNS.inputs)):
            u[i, k] = sane_loops(rows[i], COLUMNS.inputs[k])
        if math.isnan(u[i, 0]):
            u[i, 0] = command[0] + command[1] * sane_loops(rows[i], COLUMNS.command)
        for k in range(len(COLUMNS.degc)):
            degc[i, k] = sane_loops(rows[i], COLUMNS.degc[k])


def join_loops(raw: Array, measured: Counts, table: Array, order: Counts) -> None:
    """Rows of innovations from raw rows; what is in heated stores counts as measured, too."""
    motion, predicted, _ = LAYOUT
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


def observe_loops(
    rows: Array, command: tuple[float, float], swarm: tuple[Array, Array],
    pattern: tuple[Flags, Array, Array], bits: tuple[Array, Indices], table: Array,
    threshold: float, motion: tuple[bool, MotionCoefficients, Any],
    heat: tuple[Array, tuple[int, float, float]], watch: tuple[float, float, float, bool],
    frozen: bool, begun: bool, last: Array, told: tuple[Array, Counts, Flags, Counts],
) -> tuple[int, int, float]:  # fmt: skip
    """Scans until one needs what is not compiled: see ``track_loops``, which these are handed to.

    Nothing predicts the readings that a filter has ``begun`` with. ``watch`` is a
    ``ConsistencyMonitor`` and whether the track is lost; ``last`` the row of the last innovation.
    ``told`` is to be filled: rows of ``Innovations``, channels measured, where the track is lost;
    then the order of these rows.

    Returns
    -------
    How many scans were taken, with what the last of them ended it, and the monitor's level.
    """
    innovations, measured, lost, order = told
    count, p = len(bits[0]), len(COLUMNS.motion)
    inputs, y = np.empty((count, len(COLUMNS.inputs))), np.empty((count, p))
    held, degc = np.empty((count, p)), np.empty((count, len(COLUMNS.degc)))
    read_loops(rows[:count], command, (inputs, y, held, degc), measured)
    if begun:
        y[0], held[0] = math.nan, math.nan
    raw = np.empty((count, LAYOUT[2]))
    done, end = track_loops(
        swarm[0], swarm[1], (inputs, y, held, degc), pattern, bits, table, threshold, motion, heat,
        frozen, begun, raw,
    )  # fmt: skip
    level, share, limit, diverged = watch
    nis = len(last) - 2
    for i in range(done):
        if not frozen and measured[i] and not begun:
            # One outlier, of any size, is not yet a lost track.
            each = raw[i, nis] / measured[i]
            level += share * ((each if each < 10.0 * limit else 10.0 * limit) - level)
        lost[i] = diverged if frozen else level > limit
    join_loops(raw[:done], measured, innovations, order)
    for k in range(len(last) if done else 0):
        last[k] = raw[done - 1, k]
    return done, end, level


@lru_cache(maxsize=8)
def observe_of(
    equations: DrivenEquations, columns: ReadingColumns, absent: tuple[bool, ...],
    driving: tuple[bool, ...], layout: tuple[int, int, int],
) -> Callable[..., tuple[int, int, float]]:  # fmt: skip
    """``observe_loops`` of one stand, compiled."""
    read = backends.bound(read_loops, COLUMNS=columns, ABSENT=absent, DRIVING=driving)
    join = backends.bound(join_loops, LAYOUT=layout)
    track, parts = track_of(equations)
    calls = {"read_loops": read, "track_loops": track, "join_loops": join}
    loop = backends.bound(observe_loops, COLUMNS=columns, LAYOUT=layout, **calls)
    made: Callable[..., tuple[int, int, float]] = backends.compiled(
        loop, read, sane_loops, track, join, *parts
    )
    return made
