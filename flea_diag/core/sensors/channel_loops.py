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

"""Whether scans hold anything to look at: what ``stages.channels`` asks first, for numba."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]
Counts = npt.NDArray[np.int64]
Flags = npt.NDArray[np.bool_]


def glance_loops(
    values: Array, places: tuple[Counts, Counts], bounds: tuple[Array, Array, Flags],
    most: int, last: Array, raw: Array,
) -> bool:  # fmt: skip
    """Put values in their columns of ``raw``; whether all leave their channels as they are.

    So does what is inside ``bounds`` or rightly missing, in scans that have fewer than ``most``
    readings in common with the one before. ``last`` is the scan before the
    first, and renewed where all is well.
    """
    come, go = places
    low, high, lacking = bounds
    steady, before = True, last
    for i in range(len(values)):
        raw[i] = math.nan
        for k in range(len(come)):
            raw[i, go[k]] = values[i, come[k]]
        same = 0
        for c in range(len(low)):
            value = raw[i, c]
            same += value == before[c]
            steady &= low[c] < value < high[c] or (lacking[c] and math.isnan(value))
        steady &= same < most
        before = raw[i]
    if steady:
        for c in range(len(last)):
            last[c] = before[c]
    return steady


def last_loops(
    rows: Array, refused: Flags, last: Array, age: Counts, longest: int, held: Array
) -> bool:
    """What is held of each scan, see ``LastReadings``; whether that differs from the rows."""
    differs = False
    for i in range(len(rows)):
        for c in range(len(last)):
            held[i, c] = rows[i, c]
            if not math.isnan(rows[i, c]):
                last[c], age[c] = rows[i, c], 0
                continue
            within = age[c] < longest
            age[c] = min(age[c] + 1, longest)
            if within and not (len(refused) and refused[i, c]):
                held[i, c] = last[c]
            differs |= within
    return differs
