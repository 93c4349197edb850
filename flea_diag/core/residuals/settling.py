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

"""Balances that hold only some time after motion has begun, ended or turned.

A drive that nobody reads keeps the current of the motion for a while before it lowers it to that of
its standstill: a stepper's for about a second. After a start its control overshoots the speed that
the balance was stated for. What it takes then is neither its idle current nor the power of a steady
motion, so the balance is void until that time has passed and the smoothing kernel holds nothing of
it. What went before a stream is not known: it begins as if motion had just changed.
"""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from flea_diag.core.residual_values import ResidualRows
from flea_diag.core.residuals.residual_rows import ResidualSet

Flags = npt.NDArray[np.bool_]
Counts = npt.NDArray[np.int64]
Ways = npt.NDArray[np.int8]

UNKNOWN = 2
"""Way before the first scan."""


def ways(moving: Flags, speed_m_s: npt.NDArray[np.float64]) -> Ways:
    """Way of each scan, shape (n,): 1 or -1 in motion, 0 at rest."""
    return np.where(moving, np.sign(np.nan_to_num(speed_m_s)), 0.0).astype(np.int8)


def scans_of(settles_s: float, period_s: float, kernel_length: int) -> int:
    """Smoothed scans after a change of the motion that are void."""
    return math.ceil(settles_s / period_s) + kernel_length // 2 if settles_s else 0


def scans_since_change(way: Ways, last: int = UNKNOWN, before: int = 0) -> Counts:
    """Scans of the same way up to each scan, shape (n,), 1 in the first one.

    ``last`` is the way of the scan before, ``before`` its count.
    """
    scans = np.arange(1, len(way) + 1, dtype=np.int64)
    changed = np.diff(way, prepend=np.int8(last)) != 0
    return scans - np.maximum.accumulate(np.where(changed, scans - 1, -before))


class Settling:
    """Drops the residuals of one stream that have not settled."""

    def __init__(self, known: ResidualSet, period_s: float, kernel_length: int) -> None:
        waits = [(row.name, row.settles_s) for row in known.parities if row.settles_s]
        self._waits = [
            (known.place[name], scans_of(settles_s, period_s, kernel_length))
            for name, settles_s in waits
        ]
        self._last, self._since = UNKNOWN, 0

    def leave_out(self, rows: ResidualRows) -> None:
        """Take n scans, one after the other."""
        if not self._waits:
            return
        way = ways(rows.moving, rows.speed_m_s)
        since = scans_since_change(way, self._last, self._since)
        self._last, self._since = int(way[-1]), int(since[-1])
        for column, scans in self._waits:
            rows.leave_out(since <= scans, [column])
