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

"""Order of a stream of scans: late, duplicate and lost scans are counted, gaps are found.

A clock that is set while the source goes on shows in scans that are passed over and go on where the
last of them ended: smoothing starts anew behind them, and it is said.

Used are the samples that are not late, duplicate, crowded or elsewhere. ``lost`` counts scans
that never arrived, ``jumps`` lasting jumps of the timestamps.
"""

from __future__ import annotations

from collections import deque
from enum import Enum

import numpy as np
import numpy.typing as npt

from flea_diag.stages.stream.scan_rate import ScanRate
from flea_diag.wire.records import (
    NEVER_NS,
    OFF_RATE,
    STARVING,
    STREAM,
    ChannelQuality,
    Quality,
)

Stamps = npt.NDArray[np.int64]

BACK_NS = 1_000_000_000
"""A stamp further back than this comes from another clock."""
AHEAD_NS = 60_000_000_000
"""So does a stamp further ahead than this; the number of lost scans is then unknown."""
FOLLOWERS = 10
"""Consecutive scans on a new time base before it is followed. A single wrong stamp ends no
episode; of two sources, the first is used as long as it delivers."""
ACCOUNTED = 100
"""Most recent scans, whose spacing shows whether the stream is starved."""
STARVED = 2 * ACCOUNTED
"""Limit of their span in periods. A pause of the source alone does not exceed it."""
OFF_GRID = 0.25
"""Part of a period by which a stamp is beside those before it."""
DOUBLE = 1.5
"""Times the rate of the calibration from which on two sources may be the reason."""
JITTERS = 0.1
"""Part of a period by which stamps must scatter to be said to jitter."""
SAY_NS = 1_000_000_000
"""Shortest interval between reports of growing counters."""
WORDS = {
    "lost": "lost",
    "late": "too late, not used",
    "duplicate": "duplicate",
    "crowded": "less than half a period from another scan (second source?)",
    "elsewhere": "on another time base (second source, or clock set)",
    "jumps": "timestamp jumps followed",
    "steps": "steps of the clock, smoothing begun anew",
}
"""Counters besides ``samples``, and how a report names them."""


class Place(Enum):
    """Position of a scan relative to the one before."""

    NEXT = "next"
    AFTER_GAP = "after a gap"
    RESTART = "of a new stream"
    PASSED_OVER = "not to be used"


class StreamOrder:
    """Timestamps of one stream of scans, and its counters over all restarts."""

    def __init__(self, period_ns: int, gap_scans: int) -> None:
        self._period_ns = period_ns
        self._gap_scans = gap_scans
        self._counters = dict.fromkeys(("samples", *WORDS), 0)
        self._seen: deque[int] = deque(maxlen=2 + BACK_NS // period_ns)
        self._places: deque[int] = deque([0], maxlen=1 + ACCOUNTED)
        """Periods from the first scan to each of the most recent ones, without pauses."""
        self._elsewhere_ns = 0
        self._followers = 0
        self._said_ns = 0
        self._out: list[int] = []
        """Stamps of scans passed over since the last one that was used."""
        self.rate = ScanRate(period_ns)
        self._changed = self._said_starved = False
        """Whether a fault counter has changed since the last report; what that said."""
        self.first_ns: int | None = None
        self.last_ns: int | None = None

    def step(self, stamp_ns: int) -> Place:
        """Take one scan."""
        self._counters["samples"] += 1
        if self.last_ns is None:
            return self._begin(stamp_ns)
        ahead_ns = stamp_ns - self.last_ns
        if not -BACK_NS <= ahead_ns <= AHEAD_NS:
            return self._leapt(stamp_ns)
        self._followers = 0
        if 2 * ahead_ns < self._period_ns:
            return self._pass_over(stamp_ns)
        return self._take(stamp_ns, ahead_ns)

    def _take(self, stamp_ns: int, ahead_ns: int) -> Place:
        """Use a scan that comes after the last one."""
        missing = round(ahead_ns / self._period_ns) - 1
        stepped = self._stepped(stamp_ns, ahead_ns, missing)
        if missing > 0:
            self._counters["lost"] += missing
            self._changed = True
        self._out.clear()
        self._places.append(self._places[-1] + (missing + 1 if missing < ACCOUNTED else 1))
        self.last_ns = stamp_ns
        self._seen.append(stamp_ns)
        if stepped or missing >= self._gap_scans:
            # Where stamps jitter it may be that alone.
            said = stepped and self.jitter_ns < JITTERS * self._period_ns
            self._counters["steps"] += said
            self._changed |= said
            self.rate.forget()
            return Place.AFTER_GAP
        return self._rated(stamp_ns, ahead_ns, missing)

    def _rated(self, stamp_ns: int, ahead_ns: int, missing: int) -> Place:
        """Back at the rate of the calibration, a new stream begins: windows hold the other rate."""
        if not self.rate.step(ahead_ns, max(missing, 0)):
            return Place.NEXT
        self._changed = True
        self._said_ns = 0  # at once
        return Place.NEXT if self.rate.off_hz else self._begin(stamp_ns)

    def _stepped(self, stamp_ns: int, ahead_ns: int, missing: int) -> bool:
        """Whether the clock was set before this scan, while the source went on.

        Of scans that come twice or late, the next one is on the grid of the last one that was used.
        """
        beside = abs(ahead_ns / self._period_ns - (missing + 1)) > OFF_GRID
        if not self._out:
            return missing > 0 and beside and self.jitter_ns < JITTERS * self._period_ns
        chain = [*self._out[-2:], stamp_ns]
        apart = (np.diff(chain) / self._period_ns).tolist()
        goes_on = all(abs(each - 1.0) <= OFF_GRID for each in apart)
        return goes_on and (beside or len(apart) > 1)

    @property
    def jitter_ns(self) -> float:
        """Standard deviation of the stamps of the last second about their grid."""
        places = np.array(sorted(self._seen)) / self._period_ns
        beside = np.diff(places)
        beside -= np.rint(beside)
        return float(np.sqrt(np.mean(beside**2) / 2.0) * self._period_ns) if len(beside) else 0.0

    def _begin(self, stamp_ns: int) -> Place:
        self.first_ns = self.last_ns = stamp_ns
        self._seen.clear()
        self._seen.append(stamp_ns)
        self._out.clear()
        self.rate.forget()
        return Place.RESTART

    def _pass_over(self, stamp_ns: int) -> Place:
        """Count a scan out of turn: duplicate, crowded, or late (until now counted as lost)."""
        self._changed = True
        self._out = [*self._out[-1:], stamp_ns]
        apart_ns = min((abs(stamp_ns - seen_ns) for seen_ns in self._seen), default=0)
        if apart_ns == 0:
            self._counters["duplicate"] += 1
        elif 2 * apart_ns < self._period_ns:
            self._counters["crowded"] += 1
        else:
            self._counters["late"] += 1
            # A scan older than the stream was never counted as lost.
            self._counters["lost"] -= self.first_ns is not None and stamp_ns > self.first_ns
            self._seen.append(stamp_ns)
        return Place.PASSED_OVER

    def _leapt(self, stamp_ns: int) -> Place:
        """A stamp on another time base; followed after ``FOLLOWERS`` of them in a row."""
        self._changed = True
        follows = 0 < stamp_ns - self._elsewhere_ns <= BACK_NS
        self._followers = self._followers + 1 if self._followers and follows else 1
        self._elsewhere_ns = stamp_ns
        if self._followers < FOLLOWERS:
            self._counters["elsewhere"] += 1
            return Place.PASSED_OVER
        self._followers = 0
        self._counters["jumps"] += 1
        first_ns, ahead = self.first_ns, stamp_ns > (self.last_ns or 0)
        place = self._begin(stamp_ns)
        if ahead:
            # Learned offsets and the open episode remain valid; only smoothing restarts.
            self.first_ns, place = first_ns, Place.AFTER_GAP
        return place

    def leading(self, stamps_ns: Stamps) -> int:
        """How many of these scans are in order, without a loss and without a report that is due.

        A scan after a loss is left to ``step``, and so is one with which counters are reported.
        """
        if self.last_ns is None or self.starved:
            return 0
        # After scans that were passed over, one alone shows whether the clock was set.
        if self._out:
            return 0
        ahead_ns, missing = self._ahead(stamps_ns)
        wrong = (2 * ahead_ns < self._period_ns) | (missing >= 1)
        if self.unsaid:
            since_ns = stamps_ns - self._said_ns
            wrong |= (since_ns < 0) | (since_ns >= SAY_NS)
        count = int(wrong.argmax()) if wrong.any() else len(stamps_ns)
        return min(count, self.rate.leading(self.last_ns, stamps_ns[:count]))

    def follow(self, stamps_ns: Stamps) -> None:
        """Take scans that are in order according to ``leading``."""
        self._followers = 0
        self._counters["samples"] += len(stamps_ns)
        place = self._places[-1]
        self._places.extend(range(place + 1, place + 1 + len(stamps_ns)))
        self.rate.follow(self.last_ns or 0, stamps_ns)
        self.last_ns = int(stamps_ns[-1])
        self._seen.extend(stamps_ns[-(self._seen.maxlen or 0) :].tolist())

    def _ahead(self, stamps_ns: Stamps) -> tuple[Stamps, npt.NDArray[np.float64]]:
        """Time since the scan before, and number of scans missing in between."""
        ahead_ns = stamps_ns - np.append(self.last_ns or 0, stamps_ns[:-1])
        return ahead_ns, np.rint(ahead_ns / self._period_ns) - 1.0

    @property
    def starved(self) -> bool:
        """Whether more than half of the recent scans are lost or unusable."""
        return self._places[-1] - self._places[0] > STARVED

    @property
    def unsaid(self) -> bool:
        """Whether a fault counter has changed since the last report."""
        return self._changed or self.starved != self._said_starved

    def is_due(self, stamp_ns: int) -> bool:
        """Whether changed counters are to be reported with this scan."""
        return self.unsaid and not 0 <= stamp_ns - self._said_ns < SAY_NS

    def say(self, stamp_ns: int) -> ChannelQuality:
        """Report the stream: its row of DataQuality; counters are then up to date."""
        self._changed, self._said_starved, self._said_ns = False, self.starved, stamp_ns
        return self.state()

    def _off_rate(self) -> str:
        """That the rate is another than that of the calibration."""
        hz, known_hz = self.rate.off_hz, 1e9 / self._period_ns
        two = " (two sources?)" if hz > DOUBLE * known_hz else ""
        return f"{OFF_RATE}{hz:.4g} Hz{two}, the calibration is of {known_hz:g} Hz"

    def state(self) -> ChannelQuality:
        """The stream as a row of DataQuality."""
        counted = tuple(self._counters.items())
        words = "; ".join(f"{self._counters[k]} {w}" for k, w in WORDS.items() if self._counters[k])
        quality = Quality.GOOD
        jitter_ns = self.jitter_ns
        if jitter_ns > JITTERS * self._period_ns:
            words = "; ".join(filter(None, (words, f"stamps jitter by {jitter_ns / 1e6:.1f} ms")))
        if self.rate.off_hz:
            quality, words = Quality.BAD, "; ".join(filter(None, (self._off_rate(), words)))
        elif self.starved:
            quality, words = Quality.BAD, f"{STARVING}; {words}"
        last_ns = NEVER_NS if self.last_ns is None else self.last_ns
        return ChannelQuality(STREAM, quality, self.first_ns or 0, words, counted, last_ns)
