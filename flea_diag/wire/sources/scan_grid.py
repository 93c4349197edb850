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

"""Readings of several rates become scans of one rate.

A scan is made when all readings that it takes have come: by stamps alone, so that a recording
gives the scans that its live stream gave. It waits ``WAIT_NS`` for other topics, and for the
reading after it of a channel that is interpolated or averaged, but no longer than that channel's
age limit. A source that is faster than the scans wants the mean: single readings of it alias.

Readings that come slower than declared are not bridged: what lies between them would be made up,
and tests take it for an error of the sensor. A longer ``age_s`` than the default allows it.
"""

from __future__ import annotations

import math
import statistics
from collections import Counter, deque
from collections.abc import Iterable, Iterator
from itertools import takewhile

from flea_diag.wire.records import Scan
from flea_diag.wire.sources.mapping import (
    AGE_READINGS,
    HOLD,
    INTERPOLATE,
    MEAN,
    ChannelMapping,
    SourceMapping,
)

WAIT_NS = 20_000_000
"""Topics of one instant arrive in any order within this time."""
LEAP_BACK_NS, LEAP_AHEAD_NS = 1_000_000_000, 10_000_000_000
LEAPS = 10
"""So many readings in a row whose stamps leap begin a new stream; fewer are errors."""
LOOK = 25
"""Readings of which the median interval is their rate."""
SLOWER = 1.1
"""Times the declared interval beyond which readings come slower than declared."""
MOST_READINGS = 10_000
"""Readings of one term that may wait for their scans."""


class _Readings:
    """Recent readings of one term, as stamps and values."""

    def __init__(self, row: ChannelMapping, period_ns: int) -> None:
        self.interpolates = row.resample == INTERPOLATE
        self.waits = row.resample != HOLD
        self.half_ns = period_ns // 2 if row.resample == MEAN else 0
        self.age_ns = round(row.age_s * 1e9)
        self._turn = row.turn
        self._declared_ns = round(1e9 / row.rate_hz)
        self._may_bridge = row.age_s > AGE_READINGS / row.rate_hz
        self._gaps: list[int] = []
        self.slower_hz = 0.0
        """Rate of readings that come slower than declared, else 0."""
        self.kept: deque[tuple[int, float]] = deque(maxlen=MOST_READINGS)

    def forget(self) -> None:
        """A new stream begins."""
        self.kept.clear()
        self._gaps.clear()
        self.slower_hz = 0.0

    @property
    def newest_ns(self) -> int:
        return self.kept[-1][0] if self.kept else -1

    @property
    def complete_ns(self) -> int:
        """Time of the last scan for which no further reading is needed."""
        return self.newest_ns - self.half_ns

    def keep(self, stamp_ns: int, value: float) -> None:
        """Take a reading; an angle that begins anew goes on where it was."""
        if self._turn and self.kept:
            value += self._turn * round((self.kept[-1][1] - value) / self._turn)
        if self.kept and not self._may_bridge:
            self._note_rate(stamp_ns - self.newest_ns)
        self.kept.append((stamp_ns, value))

    def _note_rate(self, gap_ns: int) -> None:
        self._gaps.append(gap_ns)
        if len(self._gaps) == LOOK:
            every_ns = statistics.median(self._gaps)
            self._gaps.clear()
            slower = every_ns > SLOWER * self._declared_ns
            self.slower_hz = 1e9 / every_ns if slower else 0.0

    @property
    def _held_ns(self) -> int:
        """Longest time for which a reading is held."""
        return self._declared_ns - 1 if self.slower_hz else self.age_ns

    @property
    def _bridged_ns(self) -> float:
        """Longest time between two readings that is bridged."""
        return SLOWER * self._declared_ns if self.slower_hz else self.age_ns

    def at(self, time_ns: int) -> float:
        """Value at the time of a scan; older readings are forgotten."""
        if self.half_ns:
            near = self._near(time_ns)
            if near:
                return math.fsum(near) / len(near)
        kept = self.kept
        while len(kept) > 1 and kept[1][0] <= time_ns:
            kept.popleft()
        if not kept or kept[0][0] > time_ns:
            return math.nan
        before_ns, value = kept[0]
        if not self.interpolates or before_ns == time_ns:
            return value if time_ns - before_ns <= self._held_ns else math.nan
        if len(kept) < 2 or kept[1][0] - before_ns > self._bridged_ns:
            return math.nan
        after_ns, after = kept[1]
        return value + (after - value) * ((time_ns - before_ns) / (after_ns - before_ns))

    def _near(self, time_ns: int) -> list[float]:
        """Readings in the period about the time of a scan; those before it are forgotten.

        Its end belongs to the next one. The last reading before it stays: it is held where there
        is none in the period.
        """
        kept, begin_ns, end_ns = self.kept, time_ns - self.half_ns, time_ns + self.half_ns
        while len(kept) > 1 and kept[0][0] < begin_ns and kept[1][0] <= time_ns:
            kept.popleft()
        return [value for at_ns, value in takewhile(lambda r: r[0] < end_ns, kept)
                if at_ns >= begin_ns]  # fmt: skip


class ScanGrid:
    """Makes scans of readings.

    Attributes
    ----------
    counts
        Readings that were left out: ``disordered`` (not newer than the one before) and
        ``leaping``; and those that came ``late`` for a scan.
    streams
        Streams of stamps that rise, so far: a recording that is played again begins a new one.
    """

    def __init__(self, mapping: SourceMapping) -> None:
        self.counts: Counter[str] = Counter()
        self._rows = mapping.channels
        self._names = tuple(row.channel for row in mapping.channels)
        self._period_ns = mapping.period_ns
        self._readings = [
            _Readings(row, mapping.period_ns) for row in mapping.channels for _ in row.terms
        ]
        self._weights = [term.weight for row in mapping.channels for term in row.terms]
        self._awaited = [each for each in self._readings if each.waits]
        self.streams = 0
        self._begin()

    def _begin(self) -> None:
        self._next_ns = self._newest_ns = -1
        self._leaps = 0
        for each in self._readings:
            each.forget()

    def push(self, stamp_ns: int, values: Iterable[tuple[int, float]]) -> Iterator[Scan]:
        """Take readings of one instant, as number of the term and value; scans that are complete.

        A leap of the stamps ends the scans so far and begins new ones.
        """
        if self._newest_ns >= 0 and not (
            self._newest_ns - LEAP_BACK_NS <= stamp_ns <= self._newest_ns + LEAP_AHEAD_NS
        ):
            self._leaps += 1
            if self._leaps < LEAPS:
                self.counts["leaping"] += 1
                return
            yield from self.finish()
            self._begin()
        self._leaps = 0
        if self._next_ns < 0:
            self._next_ns = stamp_ns
            self.streams += 1
        self.counts["late"] += stamp_ns < self._next_ns - self._period_ns
        for number, value in values:
            readings = self._readings[number]
            if stamp_ns <= readings.newest_ns:
                self.counts["disordered"] += 1
            elif math.isfinite(value):
                readings.keep(stamp_ns, value)
        self._newest_ns = max(self._newest_ns, stamp_ns)
        yield from self._made(self._complete_ns())

    def slower(self) -> dict[str, float]:
        """Channels whose readings come slower than declared, each with their rate in Hz."""
        names = [row.channel for row in self._rows for _ in row.terms]
        pairs = zip(names, self._readings, strict=True)
        return {name: each.slower_hz for name, each in pairs if each.slower_hz}

    def finish(self) -> Iterator[Scan]:
        """Scans up to the last reading, complete or not."""
        yield from self._made(self._newest_ns)

    def _complete_ns(self) -> int:
        """Time up to which scans are complete."""
        newest = self._newest_ns
        waits = (max(each.complete_ns, newest - each.age_ns) for each in self._awaited)
        return min(newest - WAIT_NS, min(waits, default=newest))

    def _made(self, until_ns: int) -> Iterator[Scan]:
        while 0 <= self._next_ns <= until_ns:
            yield Scan(self._next_ns, self._names, self._values(self._next_ns))
            self._next_ns += self._period_ns

    def _values(self, time_ns: int) -> tuple[float, ...]:
        parts = [
            weight * each.at(time_ns)
            for weight, each in zip(self._weights, self._readings, strict=True)
        ]
        values, place = [], 0
        for row in self._rows:
            end = place + len(row.terms)
            values.append(row.factor * sum(parts[place:end]) + row.offset)
            place = end
        return tuple(values)
