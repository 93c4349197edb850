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

"""Detection by the evidence: opened by a fault or by a sensor's own test, closed when it is over.

Takes residuals in blocks of any length. ``Detection`` says with which scans the change may have
begun; ``Symbols`` are the signs by which the relations have deviated since.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from flea_diag.core.evidence.hypotheses import StreamHypotheses
from flea_diag.core.evidence.hypothesis_bank import ONSET_WINDOWS
from flea_diag.core.evidence.stream_windows import LawWindow
from flea_diag.core.frozen import Frozen
from flea_diag.core.run_law.run_law import VisibleSize
from flea_diag.stages.episode import Episode
from flea_diag.stages.evidence.sensor_modes import SensorKnowledge, SensorModes
from flea_diag.stages.evidence.shift_question import LOOKS
from flea_diag.stages.evidence.signs import signs
from flea_diag.stages.evidence.stream_columns import StreamColumns
from flea_diag.stages.evidence.stream_evidence import (
    EvidenceLimits,
    Found,
    StreamChange,
    StreamEvidence,
)
from flea_diag.stages.evidence.window_stamps import WindowStamps
from flea_diag.wire.blocks import ResidualBlock
from flea_diag.wire.records import (
    ANOTHER_UNIT,
    NEVER_NS,
    TAKEN_OVER,
    Detection,
    Record,
    Symbol,
    Symbols,
)

Array = npt.NDArray[np.float64]
Records = tuple[Record, ...]

QUIET, SENSOR = "quiet", "test of a single sensor"


@dataclass(frozen=True, eq=False)
class EvidenceKnowledge(Frozen):
    """What the evidence of a stand rests on.

    Attributes
    ----------
    relations
        Of the law, in its order.
    judged
        Faults by which the relations may raise an alarm; what a dead sensor reads is told by its
        own test alone.
    visible
        Sizes of faults that the law can see.
    columns, scans
        What makes the windows of one stream, and the scans of one.
    """

    hypotheses: tuple[StreamHypotheses, StreamHypotheses]
    relations: tuple[str, ...]
    judged: frozenset[str]
    limits: EvidenceLimits
    sensors: SensorKnowledge
    visible: tuple[VisibleSize, ...]
    columns: Callable[..., StreamColumns]
    scans: int

    @property
    def faults(self) -> tuple[str, ...]:
        """Fault of each model."""
        return tuple(model.fault for model in self.hypotheses[0].signatures.models)

    @property
    def of_any_unit(self) -> EvidenceKnowledge:
        """Of a unit that the law was not learned from, and of what begins while it runs."""
        another, limits = self.hypotheses[1], self.limits._replace(before=math.inf)
        return replace(self, hypotheses=(another, another), limits=limits)

    def stream(self) -> StreamEvidence:
        """Evidence of one stream."""
        judged = np.array([fault in self.judged for fault in self.faults])
        return StreamEvidence(self.hypotheses, self.limits, judged)


class EvidenceDetection:
    """The open episode, if any, and what speaks for one.

    Attributes
    ----------
    episode
        The open one, or None.
    unit_ns
        Stamp since which another unit is in use; never where none is.
    """

    def __init__(self, knowledge: EvidenceKnowledge, rearm_after_s: float) -> None:
        self._k, self._wait_ns = knowledge, rearm_after_s * 1e9
        self._last_number = 0
        self.forget()

    def forget(self) -> None:
        """A new stream begins; numbering continues."""
        self._columns, self._stream = self._k.columns(), self._k.stream()
        self._stamps = WindowStamps()
        self._errors = np.full(len(self._k.relations), np.nan)
        self._rows: list[tuple[int, Array]] = []
        self.unit_ns, self.unit_turned, self._first_ns = NEVER_NS, False, NEVER_NS
        self._begin_quiet()

    def _begin_quiet(self) -> None:
        """No episode is open."""
        self.episode: Episode | None = None
        self._change: StreamChange | None = None
        self._sensors = SensorModes(self._k.sensors)
        self._loud_ns, self._ended_ns = NEVER_NS, NEVER_NS
        self._symbols: tuple[Symbol, ...] = ()

    @property
    def is_open(self) -> bool:
        """Whether an episode is open."""
        return self.episode is not None

    def take_over(self, opened_ns: int, number: int) -> Detection:
        """Go on with an episode from before this observer was started: only a reset ends it."""
        return self._opened(Detection(opened_ns, number, True, "", math.nan, math.nan, TAKEN_OVER))

    def close(self, stamp_ns: int, why: str) -> Detection:
        """Close the open episode; what has been seen so far does not open the next one."""
        closed = Detection(stamp_ns, self._last_number, False, "", math.nan, math.nan, why)
        self._stream.rearm()
        self._begin_quiet()
        return closed

    def take(self, block: ResidualBlock) -> tuple[int, Records]:
        """The first of these scans that causes records, and these; their number and none.

        What comes after that scan has not been taken.
        """
        self._rows, self.unit_turned = [(0, self._errors)], False
        self._first_ns = int(block.stamps_ns[0]) if self._first_ns == NEVER_NS else self._first_ns
        begun = 0
        for number, window in self._columns.add(block):
            alarmed, caused = self._listen(block, slice(begun, number + 1))
            if caused and alarmed < number:
                return alarmed, caused
            stamp_ns = int(block.stamps_ns[number])
            self._stamps.add(stamp_ns)
            caused += self._judge(stamp_ns, window)
            self._rows.append((number, self._errors))
            if caused or self.unit_turned:
                return number, caused
            begun = number + 1
        return self._listen(block, slice(begun, len(block)))

    def z(self, scans: int) -> Array:
        """Standardised errors of the last window by each scan of the last block.

        Shape (scans, relations).
        """
        z = np.empty((scans, len(self._errors)))
        for first, errors in self._rows:
            z[first:] = errors
        return z

    def _listen(self, block: ResidualBlock, scans: slice) -> tuple[int, Records]:
        """Tests of single sensors are judged at every scan; the first that alarms."""
        first = self._sensors.take(block, scans)
        if self.is_open:
            self._loud_ns = max(self._loud_ns, self._sensors.loud_ns(block, scans))
        if first == len(block) or self.is_open:
            return len(block), ()
        onset = max(self._stream.history.taken - ONSET_WINDOWS, 0)
        self._change = self._stream.of_fault((onset,), self._k.limits.onset)
        name, z, limit = self._sensors.beyond(block, first)
        return first, self._begin(int(block.stamps_ns[first]), self._change, name, z, limit, SENSOR)

    def _judge(self, stamp_ns: int, window: LawWindow) -> Records:
        """What this window changes."""
        if self._change is not None:
            self._stream.history.add(window)
            self._change.evidence.add(window)
            self._errors = self._change.evidence.first.errors
            return self._followed(stamp_ns, self._change)
        if self.is_open:  # taken over: its beginning was not seen
            self._stream.history.add(window)
            return ()
        before = self._stream.other_unit
        found = self._stream.add(window)
        self._errors = self._stream.errors
        if self._stream.other_unit != before:
            self._exchanged()
        return () if found is None else self._found(stamp_ns, found)

    def _found(self, stamp_ns: int, found: Found) -> Records:
        """A fault explains more than nothing and another unit: an episode begins."""
        self._change = found.change
        _, total, squares = found.change.evidence.first.shown
        most = int(squares.argmax())
        # As far out as one relation alone would be with as much evidence.
        z = math.copysign(math.sqrt(2.0 * found.nats), total[most])
        words = f"evidence of {self._k.faults[found.model]}"
        limit = math.sqrt(2.0 * found.change.limit)
        return self._begin(stamp_ns, found.change, self._k.relations[most], z, limit, words)

    def _begin(
        self, stamp_ns: int, change: StreamChange, name: str, z: float, limit: float, test: str
    ) -> Records:
        """An episode begins."""
        places = enumerate(change.onsets, 1)
        onsets = tuple((str(rank), self._stamps.before(onset)) for rank, onset in places)
        number = self._last_number + 1
        detection = self._opened(Detection(stamp_ns, number, True, name, z, limit, test, onsets))
        self._loud_ns = stamp_ns
        return (detection, *self._signs(stamp_ns, change))

    def _opened(self, detection: Detection) -> Detection:
        self._last_number = detection.episode
        self.episode = Episode.of(detection, detection.episode)
        return detection

    def _followed(self, stamp_ns: int, change: StreamChange) -> Records:
        """New signs; whether it was another unit, or is over."""
        changed = self._signs(stamp_ns, change)
        if not change.evidence.first.ended:
            self._ended_ns = stamp_ns
        if self._stream.history.taken % LOOKS:
            return changed
        if not self._sensors and self._stream.was_unit(change, change.evidence.weighed()):
            self._begin_quiet()
            self._exchanged()
            what = stamp_ns, self._last_number, False, "", math.nan, math.nan
            return (*changed, Detection(*what, ANOTHER_UNIT))
        if self._is_over(stamp_ns, change):
            return (*changed, self.close(stamp_ns, QUIET))
        return changed

    def _is_over(self, stamp_ns: int, change: StreamChange) -> bool:
        """That it has ended is as sure as that it had begun, and for long; no sensor is loud."""
        if not self._wait_ns or stamp_ns - self._loud_ns < self._wait_ns:
            return False
        evidence = change.evidence.first
        if evidence.ended > change.limit:
            return stamp_ns - self._ended_ns >= self._wait_ns
        # Only a sensor's own test has ever deviated.
        return bool(self._sensors) and evidence.weighed().every.max() < change.limit

    def _signs(self, stamp_ns: int, change: StreamChange) -> Records:
        """Symbols, where a relation deviates by another sign than before."""
        found = signs(*change.evidence.first.shown)
        seen = {symbol.residual: symbol for symbol in self._symbols}
        for name, sign in zip(self._k.relations, found, strict=True):
            if sign and (name not in seen or seen[name].magnitude != sign):
                seen[name] = Symbol(name, sign, "?", stamp_ns)
        if tuple(seen.values()) == self._symbols:
            return ()
        self._symbols = tuple(seen.values())
        return (Symbols(stamp_ns, self._last_number, self._symbols),)

    def _exchanged(self) -> None:
        """Another unit is in use."""
        since_ns = max(self._stamps.before(self._stream.begun), self._first_ns)
        self.unit_ns, self.unit_turned = since_ns, True
