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

"""Bounded traces of streams of any length: the extremes of equal stretches of time.

Stretches double when there are too many of them, so that a spike of a single scan is still seen
in a trace of ten hours, and memory does not grow with the stream.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

MOST_STRETCHES = 512
FIRST_STRETCH_S = 0.05
DIGITS = 5

Array = npt.NDArray[np.float64]


class Envelope:
    """Extremes of several columns over stretches of time.

    Parameters
    ----------
    columns
        How many values each sample has.
    """

    def __init__(self, columns: int) -> None:
        self.stretch_s = FIRST_STRETCH_S
        self._low = np.full((MOST_STRETCHES, columns), math.inf)
        self._high = np.full((MOST_STRETCHES, columns), -math.inf)
        self._used = 0

    def add(self, time_s: float, values: Sequence[float]) -> None:
        """Add one sample at ``time_s`` >= 0 after the start; NaN is ignored."""
        self.add_block(np.array([time_s]), np.array([values], dtype=np.float64))

    def add_block(self, times_s: Array, values: Array) -> None:
        """Add n samples in any order, shapes (n,) and (n, columns)."""
        while int(times_s.max() / self.stretch_s) >= MOST_STRETCHES:
            self._double()
        at = (times_s / self.stretch_s).astype(np.int64)
        order = np.argsort(at, kind="stable")
        at, values = at[order], values[order]
        starts = np.flatnonzero(np.diff(at, prepend=-1))
        rows = at[starts]
        self._used = max(self._used, int(rows[-1]) + 1)
        self._low[rows] = np.fmin(self._low[rows], np.fmin.reduceat(values, starts))
        self._high[rows] = np.fmax(self._high[rows], np.fmax.reduceat(values, starts))

    def _double(self) -> None:
        half = MOST_STRETCHES // 2
        low, high = self._low.copy(), self._high.copy()
        self._low[:half] = np.minimum(low[0::2], low[1::2])
        self._high[:half] = np.maximum(high[0::2], high[1::2])
        self._low[half:], self._high[half:] = math.inf, -math.inf
        self._used = (self._used + 1) // 2
        self.stretch_s *= 2.0

    def extremes(self, column: int) -> tuple[list[float | None], list[float | None]]:
        """Lowest and highest value of each stretch; None without a value."""
        return (
            _rounded(self._low[: self._used, column]),
            _rounded(self._high[: self._used, column]),
        )


def _rounded(values: Array) -> list[float | None]:
    return [float(f"{v:.{DIGITS}g}") if math.isfinite(v) else None for v in values.tolist()]
