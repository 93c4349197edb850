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

"""``mean_shift_test.MeanShiftTest`` as a loop, for numba to compile: the same bits as in numpy."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from flea_diag.core.detection.mean_shift import (
    ENDS,
    FROZEN,
    GAPS,
    IS_FROZEN,
    LAST,
    LEAST,
    LONGEST,
    REFERENCE,
    WINDOWS,
    Memory,
)
from flea_diag.core.flat_state import FLAT, Flat, counts_of, numbers_of

Array = npt.NDArray[np.float64]
Flags = npt.NDArray[np.bool_]
Counts = npt.NDArray[np.int64]

ShiftInput = tuple[bool, tuple[Array, Array, Array], Flat, Memory, Array]
"""Whether shifts are judged at all, and what ``mean_shift_test_loops`` takes beside residuals."""
TESTS = CHANGE, TOLERANCE, METRIC, VARIANCE, BETWEEN, LIMIT, COLUMNS, PLACES, GATED = range(9)
"""Of what is tested: change and tolerance of the unit's parameters, metric of the loads, variance,
that between recordings, and limit; columns of values, places of spreads, and which count in motion
alone."""


def mean_shift_loops(
    row: Array, sums: Array, end: int, least: int, windows: Counts, reference: int,
    frozen: Array, is_frozen: bool, last: Array,
) -> None:  # fmt: skip
    """``mean_shift.MeanShift`` for one residual in one scan, whose sum is put at ``end``.

    Of the last column the means are added.
    """
    added = len(row) - 1
    for c in range(len(row)):
        sums[end, c] = sums[end - 1, c] + row[c]
    for w, window in enumerate(windows):
        begin = end - window
        near, far, samples = max(begin, 0), max(begin - reference, 0), min(begin, reference)
        known = begin >= 0 if is_frozen else samples >= least
        for c in range(len(row)):
            last[w, c] = math.nan
            if known:
                if is_frozen:
                    earlier = frozen[w, c]
                else:
                    earlier = (sums[near, c] - sums[far, c]) / samples
                mean = (sums[end, c] - sums[near, c]) / window
                last[w, c] = mean + earlier if c == added else mean - earlier


def mean_shift_test_loops(
    rows: tuple[Array, Array, Flags], place: tuple[Array, Array, Array], tests: Flat,
    memory: Memory, found: Array,
) -> bool:  # fmt: skip
    """Scan after scan into ``found``, z and shifts; returns whether any is beyond its limit.

    ``place``: the loads, the leverage of each residual beyond the reach, and by how much each has
    moved, of which there may be one row for all scans.
    """
    (values, spread, moving), (loads, leverage, moved) = rows, place
    store, level = memory
    change, tolerance = numbers_of(tests, CHANGE)[0], numbers_of(tests, TOLERANCE)[0]
    metric, between = numbers_of(tests, METRIC), numbers_of(tests, BETWEEN)[0]
    variance, k = numbers_of(tests, VARIANCE), numbers_of(tests, LIMIT)
    columns, places = counts_of(tests, COLUMNS)[0], counts_of(tests, PLACES)[0]
    gated, windows = counts_of(tests, GATED)[0], counts_of(level, WINDOWS)[0]
    reference, longest = counts_of(level, REFERENCE)[0, 0], counts_of(level, LONGEST)[0, 0]
    ends, gaps = counts_of(level, ENDS)[0], counts_of(level, GAPS)[0]
    least = counts_of(level, LEAST)[0]
    units, most = 1 + len(change), 1 + len(change) + len(metric)
    shape = (len(columns), len(windows), most + 1)
    last, frozen = numbers_of(level, LAST).reshape(shape), numbers_of(level, FROZEN).reshape(shape)
    is_frozen, row, beyond = counts_of(level, IS_FROZEN)[0], np.empty(most + 1), False
    for i in range(len(values)):
        here, lever = loads[min(i, len(loads) - 1)], leverage[min(i, len(leverage) - 1)]
        since = moved[min(i, len(moved) - 1)]
        for t in range(len(columns)):
            learned = 0.0
            for u in range(len(change)):
                slope = spread[i, places[t], u]
                learned += slope * change[u]
                row[1 + u] = slope * tolerance[u]
            row[0] = values[i, columns[t]] - since[columns[t]] - learned
            for u in range(len(metric)):
                row[units + u] = 0.0
                for v in range(len(metric)):
                    known = 0.0 if math.isnan(here[v]) else here[v]
                    row[units + u] += known * metric[v, u]
            row[most] = lever[columns[t]]
            gaps[t] = gaps[t] + 1 if math.isnan(row[0]) else 0
            if gaps[t] > longest:
                store[t, 0], last[t] = 0.0, math.nan
                ends[t], is_frozen[t] = 1, False
            elif gaps[t] == 0 and (moving[i] or not gated[t]):
                mean_shift_loops(
                    row, store[t], ends[t], least[t], windows, reference,
                    frozen[t], is_frozen[t] > 0, last[t],
                )  # fmt: skip
                ends[t] += 1
            for w in range(len(windows)):
                unit_variance, apart = 0.0, last[t, w, most]
                for u in range(1, units):
                    unit_variance += last[t, w, u] * last[t, w, u]
                for u in range(units, most):
                    apart += last[t, w, u] * last[t, w, u]
                found[1, i, t, w] = last[t, w, 0]
                healthy = variance[t, w] + between[t] * apart + unit_variance
                found[0, i, t, w] = last[t, w, 0] / math.sqrt(healthy)
                beyond |= abs(found[0, i, t, w]) > k[t, w]
    return beyond


MEAN_SHIFT_LOOPS = (mean_shift_test_loops, mean_shift_loops, *FLAT)
"""What ``backend.exact`` takes: the function, and what it calls."""
