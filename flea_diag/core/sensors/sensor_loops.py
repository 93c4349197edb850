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

"""``sensor_tests.SensorTests._look`` as a loop, for numba to compile: the same bits as in numpy."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

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
    rows: Array, columns: Counts, bounds: tuple[Array, Array, Array],
    stepping: tuple[Counts, bool, Counts, Array],
    recent: Array, inside: Array, z: Array, odd: Flags,
) -> tuple[bool, bool]:  # fmt: skip
    """Scan after scan; whether any reading leaps or stands still, and whether any is missing.

    ``bounds`` are the ends of each range, and how far a reading goes in a scan, ``stepping`` the
    positions, whether they are paired, and columns and units of their steps in ``z``. ``recent``
    begins with the scans before, and ``inside`` three scans before the first.
    """
    low, high, reach = bounds
    positions, paired, places, sizes = stepping
    steps = np.empty(len(positions))
    before = len(recent) - len(rows)
    anywhere = False
    for i in range(len(rows)):
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
    lacks = False
    for i in range(len(recent)):
        for c in range(len(columns)):
            lacks |= math.isnan(recent[i, c])
    return anywhere, lacks


LOOKS = (look_loops, own_loops, step_of, middle_of)
"""What ``backend.exact`` takes: the function, and what it calls."""
