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

from collections.abc import Collection, Iterator
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from flea_diag.core.residual_values import ResidualRows
from flea_diag.core.residuals.residual_rows import SPEED, ResidualRow, ResidualSet
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

    def since(self, first: int) -> _Scans:
        """Without those before the first."""
        stamps_ns, rows, z, values, moving, motion, *flags = self
        later = stamps_ns[first:], rows[first:], z[first:], values[first:], moving[first:]
        return _Scans(*later, motion[first:], *flags)


class _Counts(NamedTuple):
    """Counts of each test, of each channel, of all scans.

    ``unheated``: without a residual by prediction, though it is read, once it has had one.
    ``overall``: scans, scans at rest, void, outside the calibration, and lost.
    """

    judged: Counts
    due: Counts
    missing: Counts
    unheated: Counts
    overall: Counts


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
        tests, read = len(self._rows), len(self._channels)
        self._ends = np.cumsum([tests, tests, read, tests])
        """Where the parts of ``_Counts`` end that stand one behind the other in one row."""
        self._recent = np.zeros((0, self._ends[-1] + 5), dtype=np.int64)
        """Of each second one row."""
        self._run = np.zeros(self._recent.shape[1], dtype=np.int64)
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
        self._waiting.append(scans)
        if int(stamps_ns[-1]) < self._until_ns:
            return len(stamps_ns)
        waited = sum(len(each.stamps_ns) for each in self._waiting[:-1])
        seconds = (stamps_ns - self._begun_ns) // SECOND_NS
        ends = np.diff(seconds, prepend=self._second).nonzero()[0]
        counts, begun = self._count(waited + ends)
        last = self._close(counts, seconds[ends])
        self._begun, end = begun[last], int(ends[last])
        self._waiting = []
        if self.turned:
            return end
        self._waiting = [scans.since(end)]
        return len(stamps_ns)

    def _close(self, counts: Counts, seconds: Counts) -> int:
        """Seconds are over, each with the first scan of one of these; the last that was closed.

        That is the first that changes which tests count as not judged, if any does.
        """
        counts[0, -1], self._lost, begun = self._lost, 0, len(self._recent)
        pauses = np.minimum(np.diff(seconds, prepend=self._second) - 1, RECENT)
        behind = begun + np.cumsum(1 + pauses)
        rows = np.zeros((1 + behind[-1], counts.shape[1]), dtype=np.int64)
        rows[1 : begun + 1], rows[behind - pauses] = self._recent, counts
        sums = np.cumsum(rows, axis=0)
        recent = self._parts(sums[behind] - sums[np.maximum(behind - RECENT, 0)])
        share = recent.judged / np.maximum(recent.due, 1)
        best = np.where(self._alike, share[:, None], 0.0).max(axis=2, initial=0.0)
        enough = (recent.due >= self._least)[:, None]
        known = np.asarray((self._alike & enough).any(axis=2))
        last = -1
        while not self.turned and last + 1 < len(counts):
            last += 1
            low = np.where(self._low, best[last] < HIGH, best[last] < LOW)
            low = np.where(known[last], low, self._low) & self._counted
            self.turned = bool((low != self._low).any())
            self._low = low
        self._recent = rows[1 : behind[last] + 1][-RECENT:].copy()
        self._run = self._run + counts[: last + 1].sum(axis=0)
        self._second = int(seconds[last])
        self._until_ns = self._begun_ns + (self._second + 1) * SECOND_NS
        self.unsaid = True
        return last

    def _count(self, ends: Counts) -> tuple[Counts, Flags]:
        """Counts of the scans that wait up to each of these ends, shape (ends, counts).

        And which predictions had a residual by then, shape (ends, predictions).
        """
        _, rows, z, values, moving, motion = (
            np.concatenate(parts) for parts in list(zip(*self._waiting, strict=True))[:6]
        )
        speed, predicted = motion[:, 0], ~np.isnan(values[:, self._predicted])
        unread = np.isnan(rows)
        formed = np.isfinite(z[:, self._columns])
        formed[:, self._alone] &= ~unread[:, self._own]
        rest = ~(moving | np.isnan(speed))
        due = ~(rest[:, None] & self._gated)
        begun = np.maximum.accumulate(np.vstack((self._begun, predicted)), axis=0)
        unheated = np.zeros(formed.shape, dtype=bool)
        unheated[:, self._stores] = begun[1:] & ~predicted & ~unread[:, self._stored]
        overall = np.zeros((len(rows), 5), dtype=bool)  # as of ``_Counts``; none of them is lost
        overall[:, 0], overall[:, 1] = True, rest
        lengths = [len(scans.stamps_ns) for scans in self._waiting]
        flags = [(scans.void, scans.outside) for scans in self._waiting]
        overall[:, 2:4] = np.repeat(flags, lengths, axis=0)
        every = np.concatenate((formed & due, due, unread, unheated, overall), axis=1)
        begins = np.append(0, ends[:-1]).tolist()
        stretches = (every[a:b] for a, b in zip(begins, ends.tolist(), strict=True))
        counts = [np.count_nonzero(stretch, axis=0) for stretch in stretches]
        return np.array(counts, dtype=np.int64), begun[ends]

    def _parts(self, counts: Counts) -> _Counts:
        return _Counts(*np.split(counts, self._ends, axis=-1))

    def report(self) -> tuple[JudgedTest, ...]:
        """Each test with its shares; empty before a second is over."""
        if not len(self._recent):
            return ()
        recent, run = self._parts(self._recent.sum(axis=0)), self._parts(self._run)
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

    def _why(self, test: int, recent: _Counts) -> tuple[Cause, str]:
        """Why a test had not every scan to judge: what takes most scans."""
        scans, rest, *_ = recent.overall.tolist()
        if recent.judged[test] >= scans:
            return Cause.NONE, ""
        if recent.judged[test] >= recent.due[test] and rest:
            return Cause.AT_REST, f"at rest in {_share(rest, scans)} of the scans"
        share, cause, words = max(self._causes(test, recent), key=lambda found: found[0])
        if share:
            return cause, words
        return Cause.UNFORMED, "not formed: settling, or too few scans in a row"

    def _causes(self, test: int, recent: _Counts) -> Iterator[tuple[int, Cause, str]]:
        """Scans that each cause takes, the cause, and its words; of equal ones the first counts."""
        scans, _, void, outside, lost = recent.overall.tolist()
        for channel in self._needs[test]:
            missing, name = int(recent.missing[channel]), self._channels[channel]
            yield missing, Cause.MISSING, f"{name} lacks {_share(missing, scans)} of its readings"
        yield lost, Cause.GAP, f"{_share(lost, scans + lost)} of the scans lost"
        if self._rows[test].gate != "sensor":
            yield void, Cause.VOID, self.void_why or AT_END
            yield outside, Cause.OUTSIDE, "outside the calibration"
        unheated = int(recent.unheated[test])
        share = _share(unheated, scans)
        yield unheated, Cause.UNFORMED, f"what heats it is unknown in {share} of the scans"


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
