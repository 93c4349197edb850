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
from typing import Any, NamedTuple

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


class Places(NamedTuple):
    """``ReadingColumns``, and of each channel of motion whether it is absent and drives.

    Values, not constants: all stands of one description share what is compiled.
    """

    motion: Counts
    inputs: Counts
    command: int
    degc: Counts
    absent: Flags
    driving: Flags

    @classmethod
    def of(cls, columns: ReadingColumns, absent: Flags, driving: Flags) -> Places:
        """Of one stand."""
        motion, inputs, degc = (
            np.array(each, dtype=np.int64)
            for each in (columns.motion, columns.inputs, columns.degc)
        )
        return cls(motion, inputs, columns.command, degc, absent, driving)


def sane_loops(row: Array, column: int) -> float:
    """A reading, NaN where it is none."""
    if column < 0:
        return math.nan
    value: float = row[column]
    return value if abs(value) < ABSURD else math.nan


def read_loops(
    rows: Array, places: Places, command: tuple[float, float],
    scans: tuple[Array, Array, Array, Array], measured: Counts,
) -> None:  # fmt: skip
    """Scan after scan into ``scans``, and how many channels of motion each has measured."""
    u, y, held, degc = scans
    for i in range(len(rows)):
        measured[i] = 0
        for k in range(len(places.motion)):
            y[i, k] = math.nan if places.absent[k] else sane_loops(rows[i], places.motion[k])
            held[i, k] = y[i, k] if places.driving[k] else math.nan
            measured[i] += not math.isnan(y[i, k])
        for k in range(len(places.inputs)):
            u[i, k] = sane_loops(rows[i], places.inputs[k])
        if math.isnan(u[i, 0]):
            u[i, 0] = command[0] + command[1] * sane_loops(rows[i], places.command)
        for k in range(len(places.degc)):
            degc[i, k] = sane_loops(rows[i], places.degc[k])


def join_loops(
    raw: Array, measured: Counts, layout: tuple[int, int], table: Array, order: Counts
) -> None:
    """Rows of innovations from raw rows; what is in heated stores counts as measured, too."""
    motion, predicted = layout
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
    rows: Array, given: tuple[Places, tuple[float, float], tuple[int, int, int]],
    swarm: tuple[Array, Array], pattern: tuple[Flags, Array, Array], bits: tuple[Array, Indices],
    table: Array, threshold: float, motion: tuple[bool, MotionCoefficients, Any],
    heat: tuple[Array, tuple[int, float, float]], watch: tuple[float, float, float, bool],
    frozen: bool, begun: bool, last: Array, told: tuple[Array, Counts, Flags, Counts],
) -> tuple[int, int, float]:  # fmt: skip
    """Scans until one needs what is not compiled: see ``track_loops``, which these are handed to.

    ``given`` is how rows are read, with the command, and how many channels of motion are predicted,
    how many in all, and numbers of a raw row. Nothing predicts the readings that a filter has
    ``begun`` with. ``watch`` is a ``ConsistencyMonitor`` and whether the track is lost; ``last``
    the row of the last innovation. ``told`` is to be filled: rows of ``Innovations``, channels
    measured, where the track is lost; then the order of these rows.

    Returns
    -------
    How many scans were taken, with what the last of them ended it, and the monitor's level.
    """
    innovations, measured, lost, order = told
    places, command, (moving, predicted, numbers) = given
    count, p = len(bits[0]), len(places.motion)
    inputs, y = np.empty((count, len(places.inputs))), np.empty((count, p))
    held, degc = np.empty((count, p)), np.empty((count, len(places.degc)))
    read_loops(rows[:count], places, command, (inputs, y, held, degc), measured)
    if begun:
        y[0], held[0] = math.nan, math.nan
    raw = np.empty((count, numbers))
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
    join_loops(raw[:done], measured, (moving, predicted), innovations, order)
    for k in range(len(last) if done else 0):
        last[k] = raw[done - 1, k]
    return done, end, level


@lru_cache(maxsize=8)
def observe_of(equations: DrivenEquations) -> Callable[..., tuple[int, int, float]]:
    """``observe_loops`` of one description, compiled."""
    track, parts = track_of(equations)
    loop = backends.bound(observe_loops, track_loops=track)
    made: Callable[..., tuple[int, int, float]] = backends.compiled(
        loop, read_loops, sane_loops, track, join_loops, *parts
    )
    return made
