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

"""How far each reading has just gone: what a sensor whose error begins at once cannot hide.

A control loop may take the error of a reading back soon after, and a smoothed reading spreads it
over the kernel. So readings are compared as they come, over the shortest time that holds a whole
step: one of a mean over a scan takes two of them.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from flea_diag.core.scan_counts import ScanCounts

Array = npt.NDArray[np.float64]

LEAST_LAG = 2
"""Readings over which a step within the mean of a scan is whole."""
WHOLE_S = 0.01
"""Time that an instrument takes for a step at most: an assumption."""


class ReadingJumps:
    """Difference of each reading and the one ``LEAST_LAG`` readings, or ``WHOLE_S``, before it."""

    def __init__(self, columns: Sequence[int], counts: ScanCounts) -> None:
        self._columns = np.array(columns, dtype=int)
        self._lag = max(LEAST_LAG, counts.of(WHOLE_S))
        self._last: Array | None = None

    def step(self, rows: Array) -> Array:
        """Jumps of n >= 1 scans, shape (n, columns); NaN where a reading is missing."""
        readings = rows.take(self._columns, axis=1)
        if self._last is not None and len(rows) == 1 and self._lag > 1:
            jumps: Array = readings - self._last[0]
            self._last[:-1], self._last[-1] = self._last[1:].copy(), readings[0]
            return jumps
        before = self._last if self._last is not None else readings[:1].repeat(self._lag, axis=0)
        whole = np.concatenate((before, readings))
        self._last = whole[-self._lag :].copy()
        return np.asarray(readings - whole[: -self._lag])
