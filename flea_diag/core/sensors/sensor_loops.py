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

What ``sensor_tests.SensorTests._look`` does, and ``NoiseTest`` where nothing comes in between.
"""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from flea_diag.core.row_ring import place_loops
from flea_diag.core.sensors.noise_loops import Memory, noise_loops
from flea_diag.core.sensors.position_step import SPAN, middle_of, step_of

Array = npt.NDArray[np.float64]
Counts = npt.NDArray[np.int64]
Flags = npt.NDArray[np.bool_]


def own_loops(recent: Array, at: int, positions: Counts, paired: bool, steps: Array) -> None:
    """``SensorTests._own_steps`` of the scans from ``at`` on."""
    for s in range(len(positions)):
        steps[s] = step_of(recent[at : at + 2 * SPAN, positions[s]], min, max)
    if paired and steps[0] * steps[1] > 0.0:
        alike = min(abs(steps[0]), abs(steps[1]))
        steps[0] -= math.copysign(alike, steps[0])
        steps[1] -= math.copysign(alike, steps[1])


def look_loops(
    rows: Array, columns: Counts, bounds: Array,
    stepping: tuple[Counts, bool, Counts, Array], noise: tuple[bool, Memory, Counts],
    recent: Array, inside: Array, z: Array, odd: Flags,
) -> tuple[bool, bool, bool]:  # fmt: skip
    """Scan after scan; whether any reading leaps or stands still, and whether any is missing.

    ``bounds`` are the ends of each range, and how far a reading goes in a scan, ``stepping`` the
    positions, whether they are paired, and columns and units of their steps in ``z``. ``recent``
    begins with the scans before, and ``inside`` three scans before the first. ``noise``: whether it
    may be judged here, its memory and its columns in ``z``; at last whether it was: where no
    reading is missing and no position leaps or stands still.
    """
    low, high, reach = bounds
    positions, paired, places, sizes = stepping
    steps = np.empty(len(positions))
    count, before = len(rows), len(recent) - len(rows)
    anywhere = lacks = False
    for i in range(count):
        for c in range(len(columns)):
            last, value = recent[before + i - 1, c], rows[i, columns[c]]
            recent[before + i, c] = value
            odd[i, c] = abs(value - last) > reach[c] or value == last
            anywhere |= odd[i, c]
        own_loops(recent, i, positions, paired, steps)
        for s in range(len(steps)):
            z[i, places[s]] = steps[s] / sizes[s]
    for i in range(len(inside)):
        for c in range(len(columns)):
            value = recent[len(recent) - len(inside) + i, c]
            inside[i, c] = value if low[c] < value < high[c] else math.nan
    for i in range(len(recent)):
        for c in range(len(columns)):
            lacks |= math.isnan(recent[i, c])
    judges, memory, heard = noise
    judges &= not lacks
    for i in range(count if anywhere else 0):
        for s in range(len(positions)):
            judges &= not odd[i, positions[s]]
    if judges:
        lacking, none = np.zeros(len(columns), dtype=np.bool_), np.empty((0, 0))
        found = np.empty((count, len(columns)))
        noise_loops(inside, (lacking, none, np.empty((0, 0), dtype=np.bool_)), memory, found)
        for i in range(count):
            for c in range(len(columns)):
                z[i, heard[c]] = found[i, c]
    return anywhere, lacks, judges


LOOKS = (look_loops, own_loops, step_of, middle_of, noise_loops, place_loops)
"""What ``backend.exact`` takes: the function, and what it calls."""
