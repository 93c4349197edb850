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

"""``z_test.ZTests`` as loops, for numba to compile: the same bits as in numpy.

One call takes what some thirty calls of numpy take, which is what a scan that comes alone
spends its time on. Sums run in the order of numpy's, and no flag of the compiler lets them be
reordered (``backend.exact``), so a recording may be taken by either.
"""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from flea_diag.core.detection.window_limit import SPEED_REGIONS_M_S
from flea_diag.core.flat_state import FLAT, Flat, counts_of, numbers_of
from flea_diag.core.row_ring import place_loops
from flea_diag.core.running_mean import (
    GAP,
    LAP,
    LENGTHS,
    LONGEST,
    RUN,
    SEEN,
    SUMS,
    Memory,
)

Array = npt.NDArray[np.float64]
Flags = npt.NDArray[np.bool_]
Counts = npt.NDArray[np.int64]
Group = tuple[Memory, Array, Flat]
"""The memory, bounds, and the tables of ``GROUP``."""
GROUP = HELD, TOLERANCE, GATED, COLUMNS, PLACES, FIRST = range(6)
"""The last results, and tolerances of units; whether scans at rest are passed over; columns of
values and places of spreads; the first column that units differ in."""


def push_loops(row: Array, store: Array, valid: Flags, at: int, means: Flat) -> None:
    """``running_mean.WindowedMeans`` for one row, which is put at ``at`` of the store."""
    run, gap, longest = (
        counts_of(means, RUN)[0],
        counts_of(means, GAP)[0],
        counts_of(means, LONGEST)[0],
    )
    sums, lengths, seen = (
        numbers_of(means, SUMS),
        counts_of(means, LENGTHS)[0],
        counts_of(means, SEEN),
    )
    for c in range(len(row)):
        good = math.isfinite(row[c])
        store[at, c] = row[c] if good else 0.0
        valid[at, c] = good
        gap[c] = 0 if good else min(gap[c], longest[c]) + 1
        run[c] = run[c] + 1 if gap[c] <= longest[c] else 0
    # Row by row, and sums apart from counts: so the compiler takes several columns at once.
    for w in range(len(lengths)):
        came, left, total = store[at], store[at - lengths[w]], sums[w]
        for c in range(len(row)):
            total[c] += came[c] - left[c]
        comes, leaves, count = valid[at], valid[at - lengths[w]], seen[w]
        for c in range(len(row)):
            count[c] += int(comes[c]) - int(leaves[c])


def sum_loops(store: Array, at: int, lengths: Counts, sums: Array) -> None:
    """Sums recomputed from the rows up to ``at``."""
    for w in range(len(lengths)):
        first = at + 1 - lengths[w]
        for c in range(len(sums[w])):
            sums[w, c] = store[first, c]
        for k in range(first + 1, at + 1):
            for c in range(len(sums[w])):
                sums[w, c] += store[k, c]


def nearest_loops(means: Flat, bounds: Array, group: Flat) -> None:
    """Of each residual the test nearest to its limit: z, limit, window and growth in ``held``."""
    sums, lengths = numbers_of(means, SUMS), counts_of(means, LENGTHS)[0]
    run, gap, seen = counts_of(means, RUN)[0], counts_of(means, GAP)[0], counts_of(means, SEEN)
    held, tolerance = numbers_of(group, HELD), numbers_of(group, TOLERANCE)[0]
    start, spreading = counts_of(group, FIRST)[0, 0], len(counts_of(group, PLACES)[0])
    units, residuals = len(tolerance), held.shape[1]
    best = np.empty(residuals)
    for w in range(len(lengths)):
        length = lengths[w]
        region = 0
        if run[2 * residuals] >= length:
            for edge in SPEED_REGIONS_M_S:
                region += sums[w, 2 * residuals] / length > edge
        for c in range(residuals):
            growth = math.nan
            if run[residuals + c] >= length:
                growth = sums[w, residuals + c] / length
            variance = bounds[1, region, w, c] * growth
            if start <= c < start + spreading:
                first = 2 * residuals + 1 + (c - start) * units
                unit = 0.0
                for u in range(units):
                    moved = math.nan
                    if run[first + u] >= length:
                        moved = sums[w, first + u] / length * tolerance[u]
                    unit += moved * moved
                variance += unit
            z = math.nan
            if gap[c] == 0 and run[c] >= length and 2 * seen[w, c] >= length:
                z = (sums[w, c] / seen[w, c] - bounds[0, region, w, c]) / math.sqrt(variance)
            k = bounds[2, region, w, c]
            near = abs(z) / k
            # An untested window has no z: it is farthest from its limit.
            near = near if near > -1.0 else -1.0
            if w == 0 or near > best[c]:
                best[c], held[0, c], held[1, c] = near, z, k
                held[2, c], held[3, c] = length, math.sqrt(growth)


def row_loops(
    values: Array, growth: Array, speed_m_s: float, spreads: Array, columns: Counts,
    places: Counts, row: Array,
) -> None:  # fmt: skip
    """``z_test.ZTests.table`` for one scan."""
    count = len(columns)
    row[2 * count] = 0.0 if math.isnan(speed_m_s) else abs(speed_m_s)
    for c in range(count):
        row[c] = values[columns[c]]
        row[count + c] = growth[columns[c]]
    at = 2 * count + 1
    for place in places:
        for spread in spreads[place]:
            row[at] = 0.0 if math.isnan(spread) else spread
            at += 1


def z_test_loops(
    rows: tuple[Array, Array, Array, Array], moving: Flags, groups: tuple[Group, Group],
    results: Array,
) -> None:  # fmt: skip
    """Scan after scan, the tests of both gates; fills ``detection.TestResults.every``.

    Where a group is gated a scan at rest leaves its results as they were. Of the growth there may
    be one row for all scans.
    """
    values, growth, motion, spreads = rows
    results[:2], results[2], results[3], results[4] = math.nan, 0.0, 1.0, math.nan
    for g in range(len(groups)):
        ((store, valid), ends, means), bounds, group = groups[g]
        columns, places = counts_of(group, COLUMNS)[0], counts_of(group, PLACES)[0]
        sums, lengths = numbers_of(means, SUMS), counts_of(means, LENGTHS)[0]
        gated, lap = counts_of(group, GATED)[0, 0] > 0, counts_of(means, LAP)
        row, held, size = np.empty(store.shape[1]), numbers_of(group, HELD), lengths[-1]
        for i in range(len(values) if len(columns) else 0):
            if moving[i] or not gated:
                grown = growth[min(i, len(growth) - 1)]
                row_loops(values[i], grown, motion[i, 0], spreads[i], columns, places, row)
                at = place_loops(store, ends[0], size)
                place_loops(valid, ends[1], size)
                push_loops(row, store, valid, at, means)
                lap[0, 0] += 1
                if lap[0, 0] == size:
                    lap[0, 0] = 0
                    sum_loops(store, at, lengths, sums)
                nearest_loops(means, bounds, group)
            for c in range(len(columns)):
                for part in range(4):
                    results[part, i, columns[c]] = held[part, c]


Z_TEST_LOOPS = (
    z_test_loops, row_loops, place_loops, push_loops, sum_loops, nearest_loops, *FLAT,
)  # fmt: skip
"""What ``backend.exact`` takes: the function, and what it calls."""
