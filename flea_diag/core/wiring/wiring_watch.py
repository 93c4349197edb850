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

"""Readings of the first motion of a stream, and what they say of the wiring of its channels.

Readings in motion are kept, and looked at when there are enough: a first time early, for a fault
that no wiring explains need not wait. Where the relations hold they are kept for the first
deviation, which looks once more: a lag may show later than in the first seconds.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from flea_diag.core.scan_counts import ScanCounts
from flea_diag.core.sensors.quality import BEYOND_BOUNDS
from flea_diag.core.wiring.wiring_search import WiringFinding, WiringSearch

Array = npt.NDArray[np.float64]
Flags = npt.NDArray[np.bool_]
Stamps = npt.NDArray[np.int64]

LOOKS_S = (2.0, 5.0, 10.0)
"""Times in motion after which the readings are looked at; more are not kept. Nothing is found
before the second one, unless none follows for long."""
TAIL_S = 1.0
"""Time at rest after a motion that is kept as well."""
MOST_S = 40.0
"""Time of readings beyond which none are kept: of motions that are too short to tell."""
PATIENCE_S = ((0.5, 8.0), (LOOKS_S[0], 30.0), (LOOKS_S[1], 12.0))
"""Up to so much motion, how long after the first deviation more is waited for."""
SPIKES = 0.05
"""Share of the readings of a channel out of range up to which these are left out; more of them are
of another unit, and are looked at as well."""


class WiringWatch:
    """Collects readings of one stream, and looks at them whenever it is ``due``.

    ``finding`` is what was found, None while nothing is.
    """

    def __init__(self, search: WiringSearch, counts: ScanCounts, period_s: float) -> None:
        self._search, self._counts = search, counts
        self._period_ns = round(period_s * 1e9)
        self._looks = [counts.of(time_s) for time_s in LOOKS_S]
        self._tail, self._most = counts.of(TAIL_S), counts.of(MOST_S)
        self.begin()

    def begin(self) -> None:
        """Look at what comes from now on."""
        self.finding: WiringFinding | None = None
        self._rows: list[Array] = []
        self._kept = self._moved = self._look = 0
        self._still = self._tail + 1
        self._last_ns: int | None = None
        self._now_ns = 0
        self._opened_ns: int | None = None
        self._before = 0
        self._released = False
        self.is_open, self.due = True, False
        """Whether it still collects; whether the readings are to be looked at now."""

    def close(self) -> None:
        """Collect no more."""
        self._rows, self.is_open, self.due = [], False, False

    @property
    def waits(self) -> bool:
        """Whether a test deviates, and whether by its wiring is not known yet."""
        return self.is_open and self._opened_ns is not None and not self._released

    @property
    def _is_full(self) -> bool:
        return self._look == len(self._looks) or self._kept >= self._most

    def deviates(self, stamp_ns: int) -> None:
        """A test deviates: readings are looked at, the first time, if there are any to look at."""
        if self.is_open and self._opened_ns is None:
            self._opened_ns = stamp_ns
            # A fault may have begun some time before.
            before = sum(map(len, self._rows)) - self._looks[0]
            self._before = before if before >= self._looks[0] else 0
            self.due |= self._look > 0 or self._is_full

    def take(self, stamps_ns: Stamps, raw: Array, usable: Array, moving: Flags) -> int:
        """Take n scans, shape (n, channels) each; the first with which it is due, or n.

        ``usable`` are the readings without those out of range. ``decide`` is asked at the first
        scan with which it is due, before any other is taken.
        """
        count, self._now_ns = len(stamps_ns), int(stamps_ns[-1])
        rests = self._still > self._tail and not moving.any()
        if not self.is_open or self._is_full or (rests and not self.waits):
            return count
        places = np.arange(count)
        still = places - np.maximum.accumulate(np.where(moving, places, -self._still))
        keep = still <= self._tail
        moved, kept = self._moved + np.cumsum(moving), self._kept + np.cumsum(keep)
        due = (moved >= self._looks[self._look]) | (kept >= self._most)
        if self.waits and self._opened_ns is not None:
            due |= stamps_ns - self._opened_ns >= self._patience_ns(moved)
        self._keep(stamps_ns[keep], np.stack((raw[keep], usable[keep]), axis=1))
        self._still = min(int(still[-1]) + 1, self._tail + 1)
        self._moved, self._kept = int(moved[-1]), int(kept[-1])
        self.due = bool(due.any())
        return int(due.argmax()) if self.due else count

    def _patience_ns(self, moved: npt.NDArray[Any]) -> Array:
        """How long after the first deviation is waited, after so many scans in motion."""
        enough, times_s = zip(*PATIENCE_S, strict=True)
        place = np.searchsorted([self._counts.of(time_s) for time_s in enough], moved, "right")
        return 1e9 * np.array([*times_s, 0.0])[place]

    def _keep(self, stamps_ns: Stamps, rows: Array) -> None:
        """Keep readings, parted by one of nothing where others lie between."""
        if not len(rows):
            return
        before = stamps_ns[:1] if self._last_ns is None else np.array([self._last_ns])
        apart = np.diff(stamps_ns, prepend=before) > 1.5 * self._period_ns
        for number, run in enumerate(np.split(rows, np.flatnonzero(apart))):
            self._rows += [np.full_like(rows[:1], np.nan), run] if number else [run]
        self._last_ns = int(stamps_ns[-1])

    def decide(self) -> None:
        """Look at the readings."""
        self.due = False
        if self._moved < self._looks[0] and not self._is_full:
            self._released = True
            return
        deviates = self._opened_ns is not None
        readings = _readings(np.concatenate(self._rows))
        result = self._search.search(readings, deviates, self._before)
        if result.finding is not None and not self._is_early:
            self.finding = result.finding
            self.close()
            return
        nothing = result.contradicted or not self._is_early
        self._released |= result.finding is None and nothing
        while self._look < len(self._looks) and self._moved >= self._looks[self._look]:
            self._look += 1
        if self._is_full and (deviates or result.contradicted):
            self.close()

    @property
    def _is_early(self) -> bool:
        """Whether more motion is waited for before anything is found."""
        if self._moved >= self._looks[1] or self._is_full or self._released:
            return False
        waited_ns = self._now_ns - (self._now_ns if self._opened_ns is None else self._opened_ns)
        return waited_ns < float(self._patience_ns(np.array([self._moved]))[0])


def _readings(rows: Array) -> Array:
    """Usable readings of shape (n, 2, channels); all of a channel that is often out of range."""
    raw, usable = rows[:, 0], rows[:, 1]
    read, used = np.isfinite(raw).sum(axis=0), np.isfinite(usable).sum(axis=0)
    made = np.where(used < (1.0 - SPIKES) * read, raw, usable)
    return np.where(np.abs(made) < BEYOND_BOUNDS, made, np.nan)
