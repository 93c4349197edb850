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

"""Readings at a limit of their range while a part is at an end of its travel, or has run away.

A stop stretches what lies between two positions and loads what pushes against it: a position
stands at the end of its scale while the other goes on, a load cell reads what it can. A motor that
nothing holds turns faster than ever, and its back-EMF is more than a voltmeter reads. Such a
reading says that there is at least so much, so no relation holds with it. Elsewhere it is the
sensor that is at fault.

A relation of the circuit holds whatever the part meets, and is a sum of readings: there "at least
so much" says which way the truth lies. Where that is farther out than what was computed, the
relation has missed by at least this, and keeps its value (``bounding``).
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import numpy.typing as npt

from flea_diag.core.conditions.bounding import Bounding
from flea_diag.core.residual_values import ResidualRows
from flea_diag.core.residuals.residual_rows import ResidualSet

Array = npt.NDArray[np.float64]
Flags = npt.NDArray[np.bool_]


class ClippedReadings:
    """State of one stream: which channels are clipped, or were within so many scans."""

    def __init__(self, rows: ResidualSet, scans: int, bounding: Bounding) -> None:
        kept = {*range(len(rows.rows))[rows.sensor_columns], *bounding.columns}
        self._bounding = bounding
        self._columns = [
            [column for column in rows.needing(name) if column not in kept]
            for name in rows.channels
        ]
        self._channels, self._scans = rows.channels, scans
        self.use({})
        self._left = np.zeros((2, len(rows.channels)), dtype=np.int64)
        """For how many scans more it counts that a channel was at its lower and its upper limit."""
        self._lingers = False
        self._void: Flags | None = None

    def use(self, ranges: Mapping[str, tuple[float, float]]) -> None:
        """Take the ranges of channels; one without a range is never clipped."""
        bounds = [ranges.get(name, (-np.inf, np.inf)) for name in self._channels]
        self._low, self._high = np.array(bounds).T

    def step(self, rows: Array, beyond: bool | Flags) -> None:
        """Take n scans, shape (n, channels).

        ``beyond``: whether the part came to an end of its travel, or has run away, in all or (n,).
        """
        self._void = None
        if not (np.any(beyond) if isinstance(beyond, np.ndarray) else beyond) and not self._lingers:
            return
        there = np.broadcast_to(beyond, len(rows))
        clipped = np.stack((rows <= self._low, rows >= self._high), axis=1) & there[:, None, None]
        if not (clipped.any() or self._lingers):
            return
        void = np.empty_like(clipped)
        for scan, now in enumerate(clipped):
            self._left = np.where(now, self._scans, np.maximum(self._left - 1, 0))
            void[scan] = self._left > 0
        self._void, self._lingers = void, bool(self._left.any())

    def leave_out(self, residuals: ResidualRows) -> None:
        """Drop what needs a clipped reading, unless it has missed by at least what it says."""
        if self._void is None or len(self._void) != len(residuals):
            return
        self._bounding.leave_out(residuals, self._void)
        either = np.asarray(self._void.any(axis=1))
        for channel in np.flatnonzero(either.any(axis=0)).tolist():
            residuals.leave_out(either[:, channel], self._columns[channel])
