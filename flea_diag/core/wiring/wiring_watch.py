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

A channel that is wired wrong is so from the first scan on, so a fault that begins later is none:
the readings are looked at after a little motion, and are kept for a second look only if some wiring
explains them. Nothing is said, and no scan is an event, while the relations hold.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from flea_diag.core.scan_counts import ScanCounts
from flea_diag.core.sensors.quality import BEYOND_BOUNDS
from flea_diag.core.wiring.wiring_search import WiringFinding, WiringSearch, is_judged

Array = npt.NDArray[np.float64]
Flags = npt.NDArray[np.bool_]
Stamps = npt.NDArray[np.int64]

LOOKS_S = (2.0, 4.0, 6.0)
"""Times in motion after which the readings are looked at; more are not kept."""
TAIL_S = 1.0
"""Time at rest after a motion that is kept as well."""
MOST_S = 40.0
"""Time of readings beyond which none are kept: of motions that are too short to tell."""
PATIENCE_S = 10.0
"""How long after the first deviation more motion is waited for."""
SPIKES = 0.05
"""Share of the readings of a channel out of range up to which these are left out; more of them are
of another unit, and are looked at as well."""


class WiringWatch:
    """Collects the first readings of one stream, and looks at them whenever it is ``due``.

    ``finding`` is what was found, None while nothing is; ``is_open`` whether it still looks.
    """

    def __init__(self, search: WiringSearch, counts: ScanCounts, period_s: float) -> None:
        self._search = search
        self._period_ns, self._bridge = round(period_s * 1e9), counts.kernel
        self._looks = [counts.of(time_s) for time_s in LOOKS_S]
        self._tail, self._most = counts.of(TAIL_S), counts.of(MOST_S)
        self.begin()

    def begin(self) -> None:
        """Look at what comes from now on."""
        self.finding: WiringFinding | None = None
        self._rows: list[Array] = []
        self._kept = self._moved = self._first = self._look = 0
        self._still = self._tail + 1
        self._last_ns: int | None = None
        self._opened_ns: int | None = None
        self.is_open, self.due = True, False

    def close(self) -> None:
        """Look no more."""
        self._rows, self.is_open, self.due = [], False, False

    @property
    def waits(self) -> bool:
        """Whether a test deviates, and whether by its wiring is not known yet."""
        return self.is_open and self._opened_ns is not None

    def deviates(self, stamp_ns: int) -> None:
        """A test deviates."""
        if self._opened_ns is None:
            self._opened_ns = stamp_ns

    def take(self, stamps_ns: Stamps, raw: Array, usable: Array, moving: Flags) -> int:
        """Take n scans, shape (n, channels) each: the first with which it is due, or n.

        ``usable`` are the readings without those out of range. What follows that scan is not taken.
        """
        at, count = 0, len(stamps_ns)
        while self.is_open and not self.due and at < count:
            still = self._still_for(moving[at:])
            keep = still <= self._tail
            ends = self._moved + np.cumsum(moving[at:]) >= self._looks[self._look]
            ends |= self._kept + np.cumsum(keep) >= self._most
            if self._opened_ns is not None:
                ends |= stamps_ns[at:] - self._opened_ns >= 1e9 * PATIENCE_S
            taken = int(ends.argmax()) + 1 if ends.any() else len(ends)
            part = np.flatnonzero(keep[:taken]) + at
            self._keep(stamps_ns[part], np.stack((raw[part], usable[part]), axis=1))
            self._still = min(int(still[taken - 1]), self._tail + 1)
            self._moved += int(moving[at : at + taken].sum())
            at += taken
            if ends[taken - 1]:
                self._glance()
        return at - 1 if self.due else count

    def _still_for(self, moving: Flags) -> npt.NDArray[np.int64]:
        """For how many scans it has not moved, at each of these scans."""
        places = np.arange(len(moving))
        return places - np.maximum.accumulate(np.where(moving, places, -1 - self._still))

    def _keep(self, stamps_ns: Stamps, rows: Array) -> None:
        """Keep readings; scans that lie between are scans without a reading."""
        if not len(rows):
            return
        before = stamps_ns[:1] if self._last_ns is None else np.array([self._last_ns])
        lost = np.rint(np.diff(stamps_ns, prepend=before) / self._period_ns).astype(int) - 1
        places = np.repeat(np.arange(len(rows)), np.clip(lost, 0, self._bridge))
        self._rows.append(np.insert(rows, places, np.nan, axis=0))
        self._last_ns, self._kept = int(stamps_ns[-1]), self._kept + len(rows)

    def _glance(self) -> None:
        """Go on without a word where nothing is waited for and the relations hold, as mostly."""
        if self.waits:
            self.due = True
        elif self._moved < self._looks[0]:
            self.close()
        else:
            held = self._search.hold(self._readings())
            self.due = is_judged(held) and not held.is_typical
            if not self.due:
                self._go_on(is_done=is_judged(held))

    def decide(self) -> None:
        """Look at the readings: once more if some wiring explains the first ones."""
        self.due = False
        if self._moved < self._looks[0]:
            self.close()
            return
        rows = self._readings()
        held = self._search.hold(rows)
        if not self._first and is_judged(held):
            self._first = len(rows)
        if self._is_last:
            self.finding = self._search.search(rows, held, self._first) if self._first else None
            self.close()
        else:
            suspected = self._first > 0 and self._search.suspects(rows, held)
            self._go_on(is_done=self._first > 0 and not suspected)
            if suspected:
                self._look = len(self._looks) - 1

    def _go_on(self, is_done: bool) -> None:
        if is_done or self._is_last:
            self.close()
        else:
            self._look += 1

    @property
    def _is_last(self) -> bool:
        """Whether no more motion is waited for."""
        return self._look == len(self._looks) - 1 or self._moved < self._looks[self._look]

    def _readings(self) -> Array:
        """Usable readings, shape (n, channels); all of a channel that is often out of range."""
        rows = np.concatenate(self._rows)
        raw, usable = rows[:, 0], rows[:, 1]
        read, used = np.isfinite(raw).sum(axis=0), np.isfinite(usable).sum(axis=0)
        made = np.where(used < (1.0 - SPIKES) * read, raw, usable)
        return np.where(np.abs(made) < BEYOND_BOUNDS, made, np.nan)
