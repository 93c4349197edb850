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

"""Ledger of judgement: in which share of the scans each test had something to judge, and why not.

Counted by seconds of the stream, so that blocks and single scans give the same. A test counts as
not judged once it had less than a tenth of the scans in which it should have judged, and as judged
again with three tenths; both over the last ten seconds.
"""

from __future__ import annotations

from collections.abc import Collection
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from flea_diag.core.residuals.residual_rows import SPEED, ResidualRow, ResidualRows, ResidualSet
from flea_diag.core.scan_counts import ScanCounts
from flea_diag.wire.records import SECOND_NS, Cause, JudgedTest

Array = npt.NDArray[np.float64]
Counts = npt.NDArray[np.int64]
Flags = npt.NDArray[np.bool_]
Stamps = npt.NDArray[np.int64]

RECENT = 10
"""Seconds that count as recent."""
LEAST_S = 3.0
"""Time in which a test should have judged before it can count as not judged."""
AT_END = "void at an end of travel"
LOW, HIGH = 0.1, 0.3
"""Share of that time below which a test counts as not judged, and from which as judged again."""


class _Scans(NamedTuple):
    """What is kept of some scans until their second is over."""

    stamps_ns: Stamps
    rows: Array
    z: Array
    values: Array
    moving: Flags
    motion: Array
    void: bool
    outside: bool


class _Second(NamedTuple):
    """Counts of one second, or of several added up: of each test, of each channel, of all scans.

    ``unheated``: without a residual by prediction, though it is read, once it has had one.
    ``overall``: scans, scans at rest, void, outside the calibration, and lost.
    """

    judged: Counts
    due: Counts
    missing: Counts
    unheated: Counts
    overall: Counts

    def plus(self, other: _Second) -> _Second:
        return _Second(*(mine + its for mine, its in zip(self, other, strict=True)))


class JudgementLedger:
    """Ledger of one stream; constant memory.

    Parameters
    ----------
    known : residuals of the stand
    tested : names of those that the calibration has limits for
    channels : those of the calibration
    counts : scans at the rate of the stand
    """

    def __init__(
        self,
        known: ResidualSet,
        tested: Collection[str],
        channels: Collection[str],
        counts: ScanCounts,
    ) -> None:
        self._columns = np.array([k for k, r in enumerate(known.rows) if r.name in tested], int)
        self._rows = [known.rows[k] for k in self._columns]
        self._gated = np.array([row.gate == "moving" for row in self._rows], dtype=bool)
        alone = [k for k, row in enumerate(self._rows) if row.gate == "sensor"]
        self._alone = np.array(alone, dtype=int)
        self._own = np.array([known.channel(self._rows[k].needs[0]) for k in alone], dtype=int)
        stores = [k for k, row in enumerate(self._rows) if row.name in known.predictions]
        self._stores, self._predicted = np.array(stores, dtype=int), self._columns[stores]
        self._stored = np.array([known.channel(self._rows[k].needs[0]) for k in stores], dtype=int)
        self._begun: Flags = np.zeros(len(stores), dtype=bool)
        motion = [n for n in (known.encoder, *known.positions) if n in channels][:1]
        self._needs = [_needed(row, known, motion) for row in self._rows]
        self._channels = known.channels
        # A relation is judged where one form of it is.
        relations = [known.relation(row.name) for row in self._rows]
        self._alike = np.array([[one == other for other in relations] for one in relations])
        # What the state observer tests is frozen in an episode, and detects alone.
        innovations = known.innovations
        self._counted = np.array([row.name not in innovations for row in self._rows], dtype=bool)
        self._least = counts.of(LEAST_S)
        self._waiting: list[_Scans] = []
        self._lost = 0
        self._second, self._begun_ns, self._until_ns = 0, 0, 0
        self._recent: list[_Second] = []
        self._run = self._nothing()
        self._low: Flags = np.zeros(len(self._rows), dtype=bool)
        self.void_why = ""
        """Why tests are void; empty: by an end of travel."""
        self.turned = False
        """Whether the last scan has changed which tests count as not judged."""
        self.unsaid = False
        """Whether a second has been counted since the last report."""

    def begin(self, stamp_ns: int) -> None:
        """The first scan is that of this stamp."""
        self._begun_ns, self._until_ns = stamp_ns, stamp_ns + SECOND_NS

    def lose(self, scans: int) -> None:
        """So many scans are lost before the next one."""
        self._lost += scans

    def take(
        self,
        stamps_ns: Stamps,
        rows: Array,
        residuals: ResidualRows,
        z: Array,
        void: bool,
        outside: bool,
    ) -> int:
        """Take n scans; the first that changes which tests count as not judged, or n."""
        self.turned = False
        values, moving, motion = residuals.values, residuals.moving, residuals.motion
        scans = _Scans(stamps_ns, rows, z, values, moving, motion, void, outside)
        if int(stamps_ns[-1]) < self._until_ns:
            self._waiting.append(scans)
            return len(stamps_ns)
        taken = 0
        while int(stamps_ns[-1]) >= self._until_ns:
            end = int(np.searchsorted(stamps_ns, self._until_ns))
            self._wait(scans, slice(taken, end))
            taken = end
            if self._close(int(stamps_ns[end])):
                self.turned = True
                return end
        self._wait(scans, slice(taken, None))
        return len(stamps_ns)

    def _wait(self, scans: _Scans, part: slice) -> None:
        if len(scans.stamps_ns[part]):
            stamps_ns, rows, z, values, moving, motion, void, outside = scans
            cut = stamps_ns[part], rows[part], z[part], values[part], moving[part], motion[part]
            self._waiting.append(_Scans(*cut, void, outside))

    def _close(self, stamp_ns: int) -> bool:
        """The second is over with the scan of this stamp; whether that changes anything."""
        counted = self._counts()
        self._waiting, self._lost = [], 0
        passed = (stamp_ns - self._begun_ns) // SECOND_NS
        pause = min(passed - self._second - 1, RECENT)
        self._recent = [*self._recent, counted, *([self._nothing()] * pause)][-RECENT:]
        self._second, self._until_ns = passed, self._begun_ns + (passed + 1) * SECOND_NS
        self._run = self._run.plus(counted)
        self.unsaid = True
        recent = self._sum()
        share = recent.judged / np.maximum(recent.due, 1)
        best = np.where(self._alike, share, 0.0).max(axis=1, initial=0.0)
        low = np.where(self._low, best < HIGH, best < LOW)
        known = (self._alike & (recent.due >= self._least)).any(axis=1)
        low = np.where(known, low, self._low) & self._counted
        changed = bool((low != self._low).any())
        self._low = low
        return changed

    def _counts(self) -> _Second:
        """Counts of the scans that wait."""
        if not self._waiting:
            return self._nothing(lost=self._lost)
        _, rows, z, values, moving, motion = (
            np.concatenate(parts) for parts in list(zip(*self._waiting, strict=True))[:6]
        )
        speed, predicted = motion[:, 0], ~np.isnan(values[:, self._predicted])
        unread = np.isnan(rows)
        formed = np.isfinite(z[:, self._columns])
        formed[:, self._alone] &= ~unread[:, self._own]
        rest = ~(moving | np.isnan(speed))
        due = ~(rest[:, None] & self._gated)
        begun = np.maximum.accumulate(predicted, axis=0) | self._begun
        self._begun = begun[-1]
        unheated = np.zeros(len(self._rows), dtype=np.int64)
        unknown = begun & ~predicted & ~unread[:, self._stored]
        unheated[self._stores] = np.count_nonzero(unknown, axis=0)
        lengths = np.array([len(s.stamps_ns) for s in self._waiting])
        flags = np.array([[s.void, s.outside] for s in self._waiting])
        void, outside = (lengths[:, None] * flags).sum(axis=0)
        return _Second(
            np.count_nonzero(formed & due, axis=0),
            np.count_nonzero(due, axis=0),
            np.count_nonzero(unread, axis=0),
            unheated,
            np.array([len(rows), np.count_nonzero(rest), void, outside, self._lost]),
        )

    def _nothing(self, lost: int = 0) -> _Second:
        empty = np.zeros(len(self._rows), dtype=np.int64)
        overall = np.array([0, 0, 0, 0, lost])
        return _Second(empty, empty, np.zeros(len(self._channels), dtype=np.int64), empty, overall)

    def _sum(self) -> _Second:
        return _Second(*(sum(parts[1:], parts[0]) for parts in zip(*self._recent, strict=True)))

    def report(self) -> tuple[JudgedTest, ...]:
        """Each test with its shares; empty before a second is over."""
        if not self._recent:
            return ()
        recent, run = self._sum(), self._run
        scans, all_scans = (max(1, int(s.overall[0])) for s in (recent, run))
        found = []
        for k, row in enumerate(self._rows):
            cause, why = self._why(k, recent)
            found.append(
                JudgedTest(
                    row.name,
                    int(recent.judged[k]) / scans,
                    int(run.judged[k]) / all_scans,
                    not self._low[k],
                    cause,
                    why,
                )
            )
        return tuple(found)

    def _why(self, test: int, recent: _Second) -> tuple[Cause, str]:
        """Why a test had not every scan to judge: the first cause that holds."""
        scans, rest, void, outside, lost = recent.overall.tolist()
        if recent.judged[test] >= scans:
            return Cause.NONE, ""
        if recent.judged[test] >= recent.due[test] and rest:
            return Cause.AT_REST, f"at rest in {_share(rest, scans)} of the scans"
        for channel in self._needs[test]:
            missing = int(recent.missing[channel])
            if missing:
                name = self._channels[channel]
                return Cause.MISSING, f"{name} lacks {_share(missing, scans)} of its readings"
        if lost:
            return Cause.GAP, f"{_share(lost, scans + lost)} of the scans lost"
        if self._rows[test].gate != "sensor":
            if void:
                return Cause.VOID, self.void_why or AT_END
            if outside:
                return Cause.OUTSIDE, "outside the calibration"
        if unheated := int(recent.unheated[test]):
            share = _share(unheated, scans)
            return Cause.UNFORMED, f"what heats it is unknown in {share} of the scans"
        return Cause.UNFORMED, "not formed: settling, or too few scans in a row"


def _needed(row: ResidualRow, known: ResidualSet, motion: list[str]) -> list[int]:
    """Columns of the channels that a residual needs; ``motion`` is where the speed comes from."""
    named = [name for need in row.needs for name in (motion if need == SPEED else [need])]
    return [known.index[name] for name in named if name in known.index]


def _share(part: int, whole: int) -> str:
    """A share in words, never rounded to nothing or to all."""
    if part >= whole:
        return "all"
    percent = 100.0 * part / whole
    return f"{percent:.0f} %" if 1.0 <= percent <= 99.0 else f"{percent:.2g} %"
