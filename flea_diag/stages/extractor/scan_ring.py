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

"""The scans of the last seconds: the motion during a window of vibration."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Iterator

import numpy as np
import numpy.typing as npt

from flea_diag.core.vibration.nominal_range import VibrationOperatingPoint
from flea_diag.wire.blocks import ScanBlock
from flea_diag.wire.records import SECOND_NS, Scan

Doubles = npt.NDArray[np.float64]


class ScanRing:
    """Bounded store of scans in order of time; repeated and older ones are left out.

    ``end_ns`` is the stamp of the newest scan, -1 without any.
    """

    def __init__(self, history_s: float, gap_limit_s: float) -> None:
        self.history_ns = round(history_s * SECOND_NS)
        self.gap_limit_s = gap_limit_s
        self.end_ns = -1
        self._scans: deque[tuple[int, Scan | ScanBlock]] = deque()

    def add(self, scan: Scan) -> bool:
        """Keep a scan and drop old ones; a jump back in time clears the store."""
        stamp_ns = scan.stamp_ns
        if stamp_ns <= self.end_ns:
            if self.end_ns - stamp_ns <= self.history_ns:
                return False
            self._scans.clear()
        self._keep(stamp_ns, scan)
        return True

    def add_block(self, block: ScanBlock) -> None:
        """Keep a block of scans in order; it is split when needed."""
        if block.stamps_ns[0] <= self.end_ns:
            for scan in block.records():
                self.add(scan)
        else:
            self._keep(int(block.stamps_ns[-1]), block)

    def _keep(self, end_ns: int, scans: Scan | ScanBlock) -> None:
        self.end_ns = end_ns
        self._scans.append((end_ns, scans))
        while self._scans[0][0] < end_ns - self.history_ns:
            self._scans.popleft()

    def columns(self, start_ns: int, end_ns: int) -> tuple[dict[str, Doubles], Doubles]:
        """Channels of the scans inside a window, and their times in s after ``start_ns``."""
        scans = self._inside(start_ns, end_ns)
        times_s = np.array([(scan.stamp_ns - start_ns) / SECOND_NS for scan in scans])
        names = scans[-1].channels if scans else ()
        rows = [
            scan.values if scan.channels == names else [scan.value(name) for name in names]
            for scan in scans
        ]
        return dict(zip(names, np.array(rows, order="F").T, strict=True)), times_s

    def operating_point(self, start_ns: int, end_ns: int) -> VibrationOperatingPoint:
        """Root mean square of speed and load over the scans inside a window."""
        scans = self._inside(start_ns, end_ns)
        return VibrationOperatingPoint(_rms(scans, "motor_speed"), _rms(scans, "load_force"))

    def _inside(self, start_ns: int, end_ns: int) -> list[Scan]:
        # A block may contain scans that are too old by now.
        start_ns = max(start_ns, self.end_ns - self.history_ns)
        found = [s for s in self._backwards(start_ns) if start_ns <= s.stamp_ns <= end_ns]
        return found[::-1]

    def _backwards(self, start_ns: int) -> Iterator[Scan]:
        """Scans from the newest back to the first before a time: windows are recent."""
        for last_ns, scans in reversed(self._scans):
            if last_ns < start_ns:
                return
            if isinstance(scans, ScanBlock):
                yield from reversed(list(scans.records()))
            else:
                yield scans


def interpolated(
    values: Doubles, at_s: Doubles, times_s: Doubles, gap_limit_s: float
) -> Doubles | None:
    """A channel at ``times_s``; None if its readings have a gap above the limit."""
    known = np.isfinite(values)
    if not known.any() or not len(times_s):
        return None
    breaks_s = np.diff([times_s[0], *at_s[known], times_s[-1]])
    if breaks_s.max() > gap_limit_s:
        return None
    return np.interp(times_s, at_s[known], values[known])


def _rms(scans: list[Scan], channel: str) -> float:
    """Root mean square of a channel; NaN if no scan has it."""
    names = scans[-1].channels if scans else ()
    place = names.index(channel) if channel in names else -1
    values = [
        scan.values[place] if place >= 0 and scan.channels == names else scan.value(channel)
        for scan in scans
    ]
    known = [value for value in values if math.isfinite(value)]
    return math.sqrt(math.fsum([v * v for v in known]) / len(known)) if known else math.nan
