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

"""Clock of a source's stamps against the arrival of its messages: its offset and its drift.

A message arrives after its stamp, now and then much later: the least delay in each stretch of time
tells of the clocks alone.
"""

from __future__ import annotations

from collections import deque

import numpy as np

STRETCH_NS = 10_000_000_000
STRETCHES = 60
"""Most stretches that are looked back on: ten minutes."""
FEWEST = 3
"""Stretches without which no drift is stated."""
STEP_NS = 500_000_000
"""Change of the least delay from one stretch to the next by which a clock was set."""


class StampClock:
    """Delays of one stream, by a clock that nobody sets."""

    def __init__(self) -> None:
        self._least: deque[tuple[int, int]] = deque(maxlen=STRETCHES)
        """When each stretch began, and its least delay."""

    def arrived(self, stamp_ns: int, steady_ns: int) -> None:
        """A message with this stamp came at this time."""
        delay_ns = steady_ns - stamp_ns
        if not self._least or steady_ns - self._least[-1][0] >= STRETCH_NS:
            if self._least and abs(delay_ns - self._least[-1][1]) > STEP_NS:
                self._least.clear()
            self._least.append((steady_ns, delay_ns))
        elif delay_ns < self._least[-1][1]:
            self._least[-1] = self._least[-1][0], delay_ns

    @property
    def drift_ppm(self) -> float:
        """By how much the clock of the stamps is too slow; NaN where it is not known yet."""
        if len(self._least) < FEWEST:
            return np.nan
        first = np.array(self._least[0])
        at_s, delay_s = (np.array(self._least) - first).T * 1e-9
        return float(1e6 * np.polyfit(at_s, delay_s, 1)[0])
