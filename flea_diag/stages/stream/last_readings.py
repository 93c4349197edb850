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

"""The last reading of each channel, where one is missing for no longer than the kernel bridges."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from flea_diag.core import backend as backends
from flea_diag.core.sensors.channel_loops import last_loops

Array = npt.NDArray[np.float64]
Flags = npt.NDArray[np.bool_]

NOTHING: Flags = np.zeros((0, 0), dtype=bool)


class LastReadings:
    """Holds the readings of one stream over short gaps, for what asks where the machine is."""

    def __init__(self, channels: int, longest: int, backend: str = "auto") -> None:
        self._compiled = backends.chosen(backend) == "numba"
        self._longest = longest
        self._last = np.full(channels, np.nan)
        self._age = np.full(channels, longest, dtype=np.int64)

    def step(self, rows: Array, refused: Flags | None = None) -> Array:
        """Take n rows, shape (n, channels); the same with gaps of up to ``longest`` rows held.

        ``refused`` are readings that there were: nothing is held in their place.
        """
        if self._compiled:
            held = np.empty_like(rows)
            told = NOTHING if refused is None else refused
            memory = self._last, self._age, self._longest
            return held if backends.exact(last_loops)(rows, told, *memory, held) else rows
        missing = np.isnan(rows)
        if (missing == (self._age >= self._longest)).all():
            # Each channel is there throughout, or has long been gone.
            self._last, self._age = rows[-1], missing[-1] * self._longest
            return rows
        number = np.arange(len(rows))[:, None]
        at = np.maximum.accumulate(np.where(missing, -1, number), axis=0)
        before = at < 0
        age = number - np.where(before, -1 - self._age, at)
        found = np.where(before, self._last, np.take_along_axis(rows, np.maximum(at, 0), axis=0))
        held = np.where(age <= self._longest, found, np.nan)
        if refused is not None:
            held[refused] = np.nan
        self._last, self._age = found[-1], np.minimum(age[-1], self._longest)
        return held

    def interrupt(self) -> None:
        """There is a gap before the next scan."""
        self._age[:] = self._longest
