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

"""The look at sensors as a loop, for numba to compile: the same bits as in numpy.

What ``sensor_tests.SensorTests._look`` does, ``HeldReadings``, and ``NoiseTest`` where nothing
comes in between.
"""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from flea_diag.core.flat_state import Flat, counts_of, numbers_of
from flea_diag.core.sensors.noise_loops import NOISE_LOOPS, Memory, noise_loops
from flea_diag.core.sensors.position_step import SPAN, middle_of, step_of

Array = npt.NDArray[np.float64]
Counts = npt.NDArray[np.int64]
Flags = npt.NDArray[np.bool_]

LOOK = BOUNDS, CALM, SIZES, COLUMNS, POSITIONS, PLACES, HEARD, PAIRED, TURNED = range(9)
"""Ends of each range and how far a reading goes in a scan; statistics of a calm scan, and units of
the steps of positions; columns of the channels, the positions among them, columns of their steps
and of the noise among the tests, whether positions are paired, and the column of the position that
the motor turns, -1 without one."""
HELD = LAST, HELD_COLUMNS, COMMANDS, HELD_PLACES, HELD_LEAST, RUNS = range(6)
"""Of channels whose readings may be held: the last reading and its command; columns of both, -1
without a command, and of the test; readings without a command that are withheld; changes of the
command since the reading has changed, and readings without one."""


def own_loops(recent: Array, at: int, positions: Counts, paired: bool, steps: Array) -> None:
    """``SensorTests._own_steps`` of the scans from ``at`` on."""
    for s in range(len(positions)):
        steps[s] = step_of(recent[at : at + 2 * SPAN, positions[s]], min, max)
    if paired and steps[0] * steps[1] > 0.0:
        alike = min(abs(steps[0]), abs(steps[1]))
        steps[0] -= math.copysign(alike, steps[0])
        steps[1] -= math.copysign(alike, steps[1])


def held_loops(rows: Array, tables: Flat, usable: Array, z: Array) -> bool:
    """``held_reading.HeldReadings.step``."""
    last, runs, least = (
        numbers_of(tables, LAST), counts_of(tables, RUNS), counts_of(tables, HELD_LEAST)[0],
    )  # fmt: skip
    columns, commands = counts_of(tables, HELD_COLUMNS)[0], counts_of(tables, COMMANDS)[0]
    places, withheld = counts_of(tables, HELD_PLACES)[0], False
    for i in range(len(rows)):
        for h in range(len(columns)):
            value = rows[i, columns[h]]
            asked = rows[i, commands[h]] if commands[h] >= 0 else math.nan
            if not math.isnan(value):
                same = value == last[h, 0]
                moved = abs(asked - last[h, 1]) > 0.0
                runs[h, 0] = runs[h, 0] + int(moved) if same else 0
                runs[h, 1] = runs[h, 1] + 1 if same and math.isnan(asked) else 0
                last[h, 0] = value
                if not math.isnan(asked):
                    last[h, 1] = asked
            if commands[h] >= 0:
                z[i, places[h]] = runs[h, 0]
            if runs[h, 1] >= least[h]:
                usable[i, columns[h]] = math.nan
                withheld = True
    return withheld


def change_loops(
    rows: Array, tables: Flat, before: Array, recent: Array, z: Array, odd: Flags
) -> tuple[bool, bool]:
    """How far readings go, and the steps of positions; see ``look_loops`` for what is told."""
    reach, calm = numbers_of(tables, BOUNDS)[2], numbers_of(tables, CALM)[0]
    sizes, columns = numbers_of(tables, SIZES)[0], counts_of(tables, COLUMNS)[0]
    positions, places = counts_of(tables, POSITIONS)[0], counts_of(tables, PLACES)[0]
    paired, turned = counts_of(tables, PAIRED)[0, 0] > 0, counts_of(tables, TURNED)[0, 0]
    steps, first = np.empty(len(positions)), len(before)
    anywhere = steps_beyond = False
    for k in range(first):
        for c in range(len(columns)):
            recent[k, c] = before[k, c]
    for i in range(len(rows)):
        for k in range(len(calm)):
            z[i, k] = calm[k]
        for c in range(len(columns)):
            last, value = recent[first + i - 1, c], rows[i, columns[c]]
            recent[first + i, c] = value
            odd[i, c] = abs(value - last) > reach[c] or value == last
            anywhere |= odd[i, c]
        own_loops(recent, i, positions, paired, steps)
        for s in range(len(steps)):
            z[i, places[s]] = steps[s] / sizes[s]
        steps_beyond |= turned >= 0 and abs(z[i, turned]) > 1.0
    return anywhere, steps_beyond


def look_loops(
    rows: Array, tables: Flat, noise: tuple[bool, Memory], held: Flat, before: Array,
    recent: Array, inside: Array, usable: Array, z: Array, odd: Flags,
) -> tuple[bool, bool, bool, bool, bool]:  # fmt: skip
    """Scan after scan; whether any reading leaps or stands still, and whether any is missing.

    ``tables`` are those of ``LOOK``. ``recent`` is to be filled with the scans ``before`` and
    these, and ``inside`` begins three scans before the first. ``noise``: whether it may be judged
    here, and its memory; next it is told whether it was: where no reading is missing and no
    position leaps or stands still. Then whether the position that the motor turns has stepped, and
    whether a reading that is held is withheld.
    """
    anywhere, steps_beyond = change_loops(rows, tables, before, recent, z, odd)
    low, high, _ = numbers_of(tables, BOUNDS)
    positions, heard = counts_of(tables, POSITIONS)[0], counts_of(tables, HEARD)[0]
    count, channels, lacks = len(rows), len(low), False
    for i in range(len(inside)):
        for c in range(channels):
            value = recent[len(recent) - len(inside) + i, c]
            inside[i, c] = value if low[c] < value < high[c] else math.nan
    for i in range(len(recent)):
        for c in range(channels):
            lacks |= math.isnan(recent[i, c])
    judges, memory = noise
    judges &= not lacks
    for i in range(count if anywhere else 0):
        for s in range(len(positions)):
            judges &= not odd[i, positions[s]]
    if judges:
        lacking, none = np.zeros(channels, dtype=np.bool_), np.empty((0, 0))
        found = np.empty((count, channels))
        noise_loops(inside, (lacking, none, np.empty((0, 0), dtype=np.bool_)), memory, found)
        for i in range(count):
            for c in range(channels):
                z[i, heard[c]] = found[i, c]
    withheld = held_loops(rows, held, usable, z)
    return anywhere, lacks, judges, steps_beyond, withheld


LOOKS = (look_loops, change_loops, own_loops, step_of, middle_of, held_loops, *NOISE_LOOPS)
"""What ``backend.exact`` takes: the function, and what it calls."""
