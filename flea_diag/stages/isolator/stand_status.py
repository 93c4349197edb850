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

"""Status of the stand apart from any episode: motion, usable channels, restarts, calibration."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import numpy.typing as npt

from flea_diag.core.backend import FEW
from flea_diag.core.calibration.calibration import Calibration
from flea_diag.core.residuals.channel_units import unit_refusal
from flea_diag.core.residuals.residual_rows import ResidualSet
from flea_diag.core.scan_counts import ScanCounts
from flea_diag.core.vibration.nominal_range import NominalRanges
from flea_diag.core.vibration.unjudged import said, unjudged
from flea_diag.errors import shown
from flea_diag.stages.judgement.unjudged import Unjudged
from flea_diag.wire.records import (
    END_OF_TRAVEL,
    FREE_PER_RUN,
    MODE,
    NEVER_NS,
    OFF_RATE,
    OTHER_UNIT,
    OUTSIDE_CALIBRATION,
    STREAM,
    WIRING,
    ChannelQuality,
    ChannelTable,
    DataQuality,
    Detection,
    Quality,
    Remark,
    RemarkKind,
    UnitOffset,
)

Flags = npt.NDArray[np.bool_]
Stamps = npt.NDArray[np.int64]

UNUSABLE = (Quality.BAD, Quality.STALE, Quality.ABSENT)
LOST_NS = 3_000_000_000
"""A state observer that has diverged for this long has a model that does not fit."""
GAP_NS = 1_000_000_000
"""After a gap this long an earlier divergence is not counted on."""
EARLY_NS = 8_000_000_000
"""A deviation this soon after the start of the stream counts as present since the start."""
SEEN_MOVING_S = 0.5
"""Time in motion before motor and screw are observable."""


@dataclass
class StandStatus:
    """State of the stand, kept from scan to scan."""

    counts: ScanCounts
    residuals: ResidualSet
    axes: tuple[str, ...] = ()
    deaf: str = ""
    """Why no accelerometer is judged; empty: one is, or there is none."""
    mismatch: str = ""
    off_rate: str = ""
    """That scans come at another rate than that of the calibration; empty: they do not."""
    bad: tuple[str, ...] = ()
    contact: ChannelQuality | None = None
    """The row of data quality while the actuator is at an end of its travel."""
    mode: ChannelQuality | None = None
    """The row of data quality while the machine is in a mode that a channel tells."""
    run: ChannelQuality | None = None
    """The row of data quality of what this run has of its own, such as another payload."""
    outside: ChannelQuality | None = None
    """The row of data quality while the motion is outside what the calibration has seen."""
    unjudged: Unjudged = field(default_factory=Unjudged)
    """What had next to nothing to judge."""
    turned: tuple[object, ...] = ()
    """State of tests and channels from when the words of ``unjudged`` are."""
    other_unit: ChannelQuality | None = None
    """The row of data quality of a unit that is none of the calibration's."""
    wiring: ChannelQuality | None = None
    """The row of data quality of a channel that is wired wrong, or may be."""
    decision: Remark | None = None
    """What an operator has last decided on a unit."""
    table_ns: int = NEVER_NS
    """When the stand began: the stamp of its channel table."""
    first_ns: int = NEVER_NS
    unit_ns: int = NEVER_NS
    """When the unit was exchanged for another one."""
    taken_back: Detection | None = None
    """The last alarm that was taken back, as it was cleared."""
    offsets: tuple[UnitOffset, ...] = ()
    """What the observer has learned of this unit."""
    counters: tuple[tuple[str, int], ...] = ()
    """Counts of bad samples so far, by ``channel/counter``."""
    began_ns: int = NEVER_NS
    """First scan of the observer now running."""
    returned_ns: int = NEVER_NS
    """First scan of an observer that was restarted during the run."""
    moved: int = 0
    moved_ns: int = NEVER_NS
    lost_ns: int = NEVER_NS
    """Since when the state observer has diverged; never while it tracks."""
    last_ns: int = NEVER_NS
    """Stamp of the newest scan."""

    @property
    def start_ns(self) -> int:
        """First scan of the run: the observer's, where this isolator has come later."""
        return self.began_ns if self.came_late else self.first_ns

    def is_early(self, detected_ns: int) -> bool:
        """Whether what is detected then was there from the start of the run, or of this unit."""
        return detected_ns - max(self.start_ns, self.unit_ns) <= EARLY_NS

    @property
    def came_late(self) -> bool:
        """Whether the observer had taken scans before the first one known here."""
        return NEVER_NS < self.began_ns < self.first_ns

    @property
    def accepted(self) -> Remark | None:
        """By which an operator has accepted this unit as healthy."""
        row, decision = self.other_unit, self.decision
        if row is None or decision is None or decision.kind is not RemarkKind.UNIT_ACCEPTED:
            return None
        return decision if decision.detected_ns == row.since_ns else None

    @property
    def beyond(self) -> str:
        """What no healthy unit of the design differs by; empty for any other or accepted unit."""
        row = self.other_unit
        if row is None or row.quality is not Quality.SATURATED or self.accepted is not None:
            return ""
        return row.reason

    @property
    def wired_wrong(self) -> str:
        """Which channel is wired wrong; empty while that is not sure."""
        row = self.wiring
        return row.reason if row is not None and row.quality is Quality.BAD else ""

    @property
    def seen_moving(self) -> bool:
        """Whether it has been in motion for long enough to observe motor and screw."""
        return self.moved >= self.counts.of(SEEN_MOVING_S)

    def take_table(self, table: ChannelTable, mismatch: str, nominal: NominalRanges) -> None:
        """Take the channel table, and why the calibration does not fit it (empty: it does)."""
        axes = {r.name: r.rate_hz for r in table.channels if r.name.startswith("accelerometer")}
        self.axes, found = tuple(axes), unjudged(nominal, axes)
        self.deaf = said(found) if len(found) == len(axes) else ""
        self.mismatch, self.table_ns = mismatch, table.stamp_ns

    def take(self, quality: DataQuality) -> bool:
        """Take the observer's data quality; whether the observer has been restarted."""
        self.bad = tuple(row.channel for row in quality.channels if row.quality in UNUSABLE)
        rows = (row for row in quality.channels if row.channel == STREAM)
        self.off_rate = next((r.reason for r in rows if r.reason.startswith(OFF_RATE)), "")
        self.contact = _condition(quality, END_OF_TRAVEL)
        self.outside = _condition(quality, OUTSIDE_CALIBRATION)
        self.mode, self.run = (_said(quality, name) for name in (MODE, FREE_PER_RUN))
        self.other_unit = next((r for r in quality.channels if r.channel == OTHER_UNIT), None)
        self.wiring = next((r for r in quality.channels if r.channel == WIRING), None)
        self._take_ledger(quality)
        self.offsets, self.counters = quality.offsets, wrong_samples(quality)
        began_ns = self.began_ns = max(
            (row.since_ns for row in quality.channels if row.channel == STREAM), default=0
        )
        known_ns = max(self.first_ns, self.returned_ns)
        if known_ns == NEVER_NS or began_ns <= known_ns:
            return False
        self.returned_ns = began_ns
        return True

    def _take_ledger(self, quality: DataQuality) -> None:
        """Take what was not judged, with its words as of when that or a channel has changed.

        A node says the shares from time to time, a replay does not: both say the same verdicts.
        """
        found = Unjudged.of(quality, self.residuals)
        rows = ((row.channel, row.quality, row.since_ns) for row in quality.channels)
        turned = found.names, found.judged, quality.offsets, *rows
        if turned != self.turned:
            self.turned, self.unjudged = turned, found

    def judged(self, stamp_ns: int, rest_ns: float) -> tuple[bool, ...]:
        """What of a scan the outcome without an episode rests on."""
        return (
            self.seen_moving,
            rested(stamp_ns, self.moved_ns, rest_ns),
            diverged(stamp_ns, self.lost_ns),
        )

    def step(self, stamp_ns: int, moving: bool, lost: bool) -> None:
        """Take one scan."""
        self._begin(stamp_ns)
        self.last_ns = stamp_ns
        if moving:
            self.moved += 1
            self.moved_ns = stamp_ns
        if not lost:
            self.lost_ns = NEVER_NS
        elif self.lost_ns == NEVER_NS:
            self.lost_ns = stamp_ns

    def _begin(self, stamp_ns: int) -> None:
        if self.first_ns == NEVER_NS:
            self.first_ns = stamp_ns
        if stamp_ns - self.last_ns > GAP_NS:
            self.lost_ns = NEVER_NS

    def follow(
        self, stamps_ns: Stamps, moving: Flags, lost: Flags, rest_ns: float
    ) -> Iterator[int]:
        """Take n scans; yields the index of each scan at which the outcome may change.

        The state is that of the scan yielded, and finally that of the last scan.
        """
        if len(stamps_ns) <= FEW:
            scans = zip(stamps_ns.tolist(), moving.tolist(), lost.tolist(), strict=True)
            for row, scan in enumerate(scans):
                self.step(*scan)
                yield row
            return
        self._begin(int(stamps_ns[0]))
        self.last_ns = int(stamps_ns[-1])
        moved = self.moved + np.cumsum(moving)
        moved_ns = np.maximum.accumulate(np.where(moving, stamps_ns, self.moved_ns))
        begins = lost & ~np.append(self.lost_ns != NEVER_NS, lost[:-1])
        lost_ns = np.maximum.accumulate(np.where(begins, stamps_ns, self.lost_ns))
        lost_ns = np.where(lost, lost_ns, NEVER_NS)
        seen = np.stack(
            (
                moved < self.counts.of(SEEN_MOVING_S),
                rested(stamps_ns, moved_ns, rest_ns),
                diverged(stamps_ns, lost_ns),
            )
        )
        turns = np.flatnonzero((seen[:, 1:] != seen[:, :-1]).any(axis=0)) + 1
        for row in (0, *turns.tolist(), len(stamps_ns) - 1):
            self.moved, self.moved_ns = int(moved[row]), int(moved_ns[row])
            self.lost_ns = int(lost_ns[row])
            yield row


def _condition(quality: DataQuality, name: str) -> ChannelQuality | None:
    """The row of a condition that holds: an end of travel, or a place outside the calibration."""
    rows = (row for row in quality.channels if row.channel == name)
    return next((row for row in rows if row.quality is Quality.SATURATED), None)


def _said(quality: DataQuality, name: str) -> ChannelQuality | None:
    """A row that says something of a machine that is well."""
    return next((r for r in quality.channels if r.channel == name and r.reason), None)


def wrong_samples(quality: DataQuality) -> tuple[tuple[str, int], ...]:
    """Counters of bad samples that are not 0, as ``channel/counter``."""
    return tuple(
        (f"{row.channel}/{name}", count)
        for row in quality.channels
        if row.quality is not Quality.ABSENT
        for name, count in row.counters
        if count and name != "samples"
    )


def rested(stamp_ns: Any, moved_ns: Any, rest_ns: float) -> Any:
    """Whether the last motion is too long ago; for one scan, or elementwise for many."""
    return (moved_ns == NEVER_NS) | (stamp_ns - moved_ns > rest_ns)


def diverged(stamp_ns: Any, lost_ns: Any) -> Any:
    """Whether the state observer has diverged for too long; for one scan, or for many."""
    return (lost_ns != NEVER_NS) & (stamp_ns - lost_ns >= LOST_NS)


def mismatch(calibration: Calibration, table: ChannelTable, known: ResidualSet) -> str:
    """Why a calibration does not fit a stand with this channel table; empty where it does.

    A unit that is not that of the model comes first: no calibration fits such a stand.
    """
    units = (unit_refusal(row.name, row.unit, known.units) for row in table.channels)
    if wrong := next(filter(None, units), ""):
        return wrong
    here = {row.name for row in table.channels}
    missing = [name for name in calibration.channels if name not in here]
    if missing:
        return (
            f"the calibration requires {missing[0]}, which this stand does not have: "
            "calibrate on recordings of this stand"
        )
    voltage = table.info(known.voltage)
    if voltage is not None and voltage.sampling != calibration.voltage_sampling:
        return (
            f"the calibration is for a {known.voltage} sampled as "
            f"{shown(calibration.voltage_sampling)}, "
            f"this stand samples {shown(voltage.sampling)}: calibrate on recordings of this stand"
        )
    return ""
