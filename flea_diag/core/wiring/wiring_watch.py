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

Readings in motion are kept until they are enough to tell, then looked at once: nothing is kept of
a stream whose relations hold. Where they do not and no wiring explains it, twice as many are looked
at, once more.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from flea_diag.core.scan_counts import ScanCounts
from flea_diag.core.sensors.quality import BEYOND_BOUNDS
from flea_diag.core.wiring.wiring_search import SearchResult, WiringFinding, WiringSearch

Array = npt.NDArray[np.float64]
Flags = npt.NDArray[np.bool_]
Stamps = npt.NDArray[np.int64]

MOTION_S = 5.0
"""Time in motion after which the wiring is looked at."""
AGAIN_S = 10.0
"""The same the second time."""
TAIL_S = 1.0
"""Time at rest after a motion that is kept as well."""
MOST_S = 40.0
"""Time of readings beyond which none are kept: of motions that are too short to tell."""
PATIENCE_S = 8.0
"""Time after the first deviation that is waited for enough motion."""
LEAST_S = 2.0
"""Time in motion without which nothing can be told."""
SPIKES = 0.05
"""Share of the readings of a channel out of range up to which these are left out; more of them are
of another unit, and are looked at as well."""


class WiringWatch:
    """Collects readings of one stream until ``due``, and looks at them.

    ``finding`` is what was found, None while nothing is.
    """

    def __init__(self, search: WiringSearch, counts: ScanCounts, period_s: float) -> None:
        self._search, self._counts = search, counts
        self._period_ns = round(period_s * 1e9)
        self.finding: WiringFinding | None = None
        self.begin()

    def begin(self) -> None:
        """Look at what comes from now on; what was found stands until then."""
        self._rows: list[Array] = []
        self._motion_s = MOTION_S
        self._kept = self._moved = 0
        self._still = self._counts.of(TAIL_S) + 1
        self._last_ns: int | None = None
        self._opened_ns: int | None = None
        self.is_open, self.due = True, False
        """Whether it still collects; whether there is now enough, or no more is waited for."""

    def close(self) -> None:
        """Collect no more."""
        self._rows, self.is_open, self.due = [], False, False

    @property
    def waits(self) -> bool:
        """Whether a test deviates, and whether by its wiring is not known yet."""
        return self.is_open and self._opened_ns is not None and self._motion_s == MOTION_S

    def deviates(self, stamp_ns: int) -> None:
        """A test deviates."""
        if self._opened_ns is None:
            self._opened_ns = stamp_ns

    def take(self, stamps_ns: Stamps, raw: Array, usable: Array, moving: Flags) -> int:
        """Take n scans, shape (n, channels) each; the first with which it is due, or n.

        ``usable`` are the readings without those out of range. ``decide`` is asked at the first
        scan with which it is due, before any other is taken.
        """
        count, tail = len(stamps_ns), self._counts.of(TAIL_S)
        if not self.is_open or (self._still > tail and not self.waits and not moving.any()):
            return count
        places = np.arange(count)
        still = places - np.maximum.accumulate(np.where(moving, places, -self._still))
        keep = still <= tail
        moved, kept = self._moved + np.cumsum(moving), self._kept + np.cumsum(keep)
        due = moved >= self._counts.of(self._motion_s)
        due |= kept >= self._counts.of(MOST_S)
        if self.waits and self._opened_ns is not None:
            due |= stamps_ns - self._opened_ns >= PATIENCE_S * 1e9
        self._keep(stamps_ns[keep], np.stack((raw[keep], usable[keep]), axis=1))
        self._still = min(int(still[-1]) + 1, tail + 1)
        self._moved, self._kept = int(moved[-1]), int(kept[-1])
        self.due = bool(due.any())
        return int(due.argmax()) if self.due else count

    def _keep(self, stamps_ns: Stamps, rows: Array) -> None:
        """Keep readings, parted by one of nothing where others lie between."""
        if not len(rows):
            return
        before = stamps_ns[:1] if self._last_ns is None else np.array([self._last_ns])
        apart = np.diff(stamps_ns, prepend=before) > 1.5 * self._period_ns
        for number, run in enumerate(np.split(rows, np.flatnonzero(apart))):
            self._rows += [np.full_like(rows[:1], np.nan), run] if number else [run]
        self._last_ns = int(stamps_ns[-1])

    def decide(self) -> SearchResult:
        """Look at the readings; afterwards it is open only if more of them may tell more."""
        suspected, moved, rows = self._opened_ns is not None, self._moved, self._rows
        self.due = False
        if moved < self._counts.of(LEAST_S):
            self.finding = None
            self.close()
            return SearchResult()
        result = self._search.search(_readings(np.concatenate(rows)), suspected)
        self.finding = result.finding
        again = result.contradicted and result.finding is None and self._motion_s == MOTION_S
        if again and moved >= self._counts.of(MOTION_S):
            self._motion_s = AGAIN_S
        else:
            self.close()
        return result


def _readings(rows: Array) -> Array:
    """Usable readings of shape (n, 2, channels); all of a channel that is often out of range."""
    raw, usable = rows[:, 0], rows[:, 1]
    read, used = np.isfinite(raw).sum(axis=0), np.isfinite(usable).sum(axis=0)
    made = np.where(used < (1.0 - SPIKES) * read, raw, usable)
    return np.where(np.abs(made) < BEYOND_BOUNDS, made, np.nan)
