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

"""Shaft speed and load of the last seconds, from which vibration windows are selected."""

from __future__ import annotations

import itertools
import math
from collections import deque
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field

import numpy as np

from flea_diag.core.vibration.features_motion import reverses

LOOK_BACK_NS = 6_500_000_000
"""History kept: the slowest usual motion, including its rests, is fast once within it."""
RISING_NS = 200_000_000
"""The motion is accelerating if it is faster over this time than over the whole window."""


@dataclass
class MotionWindow:
    """Shaft speed and load over the last window, and the fastest window in the history."""

    window_ns: int
    _scans: deque[tuple[int, float, float]] = field(default_factory=deque)

    def add(self, stamp_ns: int, speed_rad_s: float, load_n: float) -> None:
        """Add one scan; NaN where not measured."""
        self.extend([(stamp_ns, speed_rad_s, load_n)])

    def extend(self, scans: Iterable[tuple[int, float, float]]) -> None:
        """Add at least one scan: stamp, speed and load of each."""
        self._scans.extend(scans)
        oldest_ns = self._scans[-1][0] - self.history_ns
        while self._scans[0][0] <= oldest_ns:
            self._scans.popleft()

    @property
    def history_ns(self) -> int:
        """Time for which scans are kept."""
        return self.window_ns + LOOK_BACK_NS

    def reaches(self, speed_rad_s: float) -> bool:
        """Whether the RMS speed reaches this value; true where the speed is not measured."""
        speed = _rms(scan[1] for scan in self._last(self.window_ns))
        return not speed < speed_rad_s

    @property
    def rises(self) -> bool:
        """Whether the shaft is accelerating."""
        now, whole = (
            _rms(scan[1] for scan in self._last(reach)) for reach in (RISING_NS, self.window_ns)
        )
        return now > whole

    def fastest_rad_s(self, since_ns: int) -> float:
        """RMS speed of the fastest whole window since then; 0 where not measured."""
        scans = [scan for scan in self._scans if scan[0] > since_ns]
        stamps_ns = np.array([stamp_ns for stamp_ns, _, _ in scans])
        squares = np.square([speed for _, speed, _ in scans])
        known = np.append(0, np.cumsum(np.isfinite(squares)))
        sums = np.append(0.0, np.cumsum(np.nan_to_num(squares)))
        ends = np.flatnonzero(stamps_ns - stamps_ns[:1] >= self.window_ns) + 1
        starts = np.searchsorted(stamps_ns, stamps_ns[ends - 1] - self.window_ns, side="right")
        means = (sums[ends] - sums[starts]) / np.maximum(known[ends] - known[starts], 1)
        return math.sqrt(means.max(initial=0.0))

    @property
    def reverses(self) -> bool:
        """Whether motion or load reverses within the last window."""
        last = list(self._last(self.window_ns))
        return reverses([scan[1] for scan in last], [scan[2] for scan in last])

    def _last(self, reach_ns: int) -> Iterator[tuple[int, float, float]]:
        """Scans of the last ``reach_ns``, the newest first."""
        since_ns = self._scans[-1][0] - reach_ns if self._scans else 0
        return itertools.takewhile(lambda scan: scan[0] > since_ns, reversed(self._scans))


def _rms(values: Iterable[float]) -> float:
    """Root mean square of the finite values; NaN where there are none."""
    known = [value * value for value in values if math.isfinite(value)]
    return math.sqrt(math.fsum(known) / len(known)) if known else math.nan
