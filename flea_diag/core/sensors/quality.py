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

"""State of each channel: good, bad, stale, saturated or absent, since when and why."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

from flea_diag.core.frozen import Frozen
from flea_diag.core.scan_counts import ScanCounts

ABSENT_S = 0.5
"""Unusable for so long a channel is bad (absent if it never had a usable value)."""
BEYOND_BOUNDS = 1e9
"""No quantity of an actuator is larger in SI units; squares and sums below it stay finite."""
SATURATED_S = 0.1
"""At the limit of its range for so long a channel is saturated: a single peak is none."""
COUNTERS = ("samples", "missing", "stale", "out_of_range", "saturated", "implausible")


@dataclass(frozen=True, slots=True)
class ChannelState(Frozen):
    """State of a channel; ``since_ns`` is the stamp at which it began."""

    quality: str
    since_ns: int
    reason: str


@dataclass
class ChannelMonitor:
    """Counts and judges one channel; ``minimum`` and ``maximum`` are its range (SI)."""

    channel: str
    minimum: float = -math.inf
    maximum: float = math.inf
    counts: ScanCounts = field(kw_only=True)
    state: ChannelState = ChannelState("absent", 0, "no value yet")
    counters: dict[str, int] = field(default_factory=lambda: dict.fromkeys(COUNTERS, 0))
    read_ns: int = -1
    """Stamp of the last usable reading; -1: none yet."""
    _unusable: int = 0
    _at_limit: int = 0

    def step(self, stamp_ns: int, value: float, trusted: bool, distrust: str) -> float:
        """Judge one value; returns it, or NaN where it is unusable.

        ``trusted`` is the result of a cross-check of several channels, ``distrust`` the reason to
        report where it fails.
        """
        self.counters["samples"] += 1
        used = self._range(value)
        if math.isnan(used):
            self._unusable += 1
        else:
            self._unusable, self.read_ns = 0, stamp_ns
        self.counters["missing"] += math.isnan(value)
        at_limit = value == used and value in (self.minimum, self.maximum)
        self._at_limit = self._at_limit + 1 if at_limit else 0
        self.counters["saturated"] += at_limit
        self.counters["implausible"] += not trusted
        quality, reason = self._judge(trusted, distrust)
        if quality != self.state.quality:
            self.state = ChannelState(quality, stamp_ns, reason)
        return used

    @property
    def reads(self) -> bool:
        """Whether another value inside the range would only change a counter."""
        return self.state.quality == "good" and self._unusable == self._at_limit == 0

    @property
    def lacks(self) -> bool:
        """Whether another missing value would only change counters."""
        known = self.counters["samples"] > self.counters["missing"]
        if self.state.quality == "absent":
            return not known
        return self.state.quality == "bad" and self._unusable >= self.counts.of(ABSENT_S)

    def pass_over(self, scans: int, last_ns: int) -> None:
        """Count ``scans`` more values up to this stamp, which change only counters."""
        self.counters["samples"] += scans
        if self.state.quality == "good":
            self.read_ns = last_ns
        else:
            self.counters["missing"] += scans
            self._unusable += scans

    @property
    def silent(self) -> bool:
        """Whether a channel that had usable values has long had none."""
        known = self.counters["samples"] > self.counters["missing"]
        return known and self._unusable >= self.counts.of(ABSENT_S)

    def _range(self, value: float) -> float:
        if math.isnan(value):
            return value
        if self.minimum <= value <= self.maximum and abs(value) <= BEYOND_BOUNDS:
            return value
        self.counters["out_of_range"] += 1
        return math.nan

    def _judge(self, trusted: bool, distrust: str) -> tuple[str, str]:
        had_one = self.counters["samples"] > self.counters["missing"]
        if self._unusable >= self.counts.of(ABSENT_S) or not had_one:
            words = f"no usable value for {self._unusable} scans" if had_one else "not measured"
            return ("bad" if had_one else "absent"), words
        if not trusted:
            return "bad", distrust
        if self._at_limit >= self.counts.of(SATURATED_S):
            return "saturated", f"at the limit of its range ({self.minimum!r} to {self.maximum!r})"
        return "good", ""
