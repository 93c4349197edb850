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

"""Detection and isolation by one evidence; Residual in, Detection and AmbiguityGroup out."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from flea_diag.core.evidence.fault_evidence import OnsetWeighed
from flea_diag.core.evidence.hypotheses import StreamHypotheses
from flea_diag.core.evidence.hypothesis_bank import ONSET_WINDOWS
from flea_diag.core.evidence.stream_windows import LawWindow
from flea_diag.stages.evidence.evidence_group import EvidenceGroup
from flea_diag.stages.evidence.evidence_verdict import EvidenceVerdict, OpenedBy, VerdictKnowledge
from flea_diag.stages.evidence.sensor_modes import SensorKnowledge, SensorModes
from flea_diag.stages.evidence.stream_columns import StreamColumns
from flea_diag.stages.evidence.stream_evidence import (
    EvidenceLimits,
    Found,
    StreamChange,
    StreamEvidence,
)
from flea_diag.wire.blocks import ResidualBlock, block_of
from flea_diag.wire.records import (
    ANOTHER_UNIT,
    Detection,
    Outcome,
    Record,
    Residual,
)

NOTHING = "no fault explains the residuals better than none"
OTHER = "another unit than the calibrated one, as healthy units differ"


@dataclass(frozen=True, eq=False)
class EvidenceKnowledge:
    """What the stage of a stand rests on.

    ``judged``: faults by which the relations may raise an alarm; what a dead sensor reads is told
    by its own test alone.
    """

    hypotheses: tuple[StreamHypotheses, StreamHypotheses]
    judged: frozenset[str]
    limits: EvidenceLimits
    verdict: VerdictKnowledge

    @property
    def faults(self) -> tuple[str, ...]:
        """Fault of each model."""
        return tuple(model.fault for model in self.hypotheses[0].signatures.models)


class EvidenceStage:
    """See the module's first line. An episode ends where all of it was another unit."""

    consumes: tuple[type, ...] = (Residual,)
    takes_blocks = True

    def __init__(
        self, knowledge: EvidenceKnowledge, columns: StreamColumns, sensors: SensorKnowledge
    ) -> None:
        self._knowledge, self._faults = knowledge, knowledge.faults
        self._columns, self._sensors = columns, SensorModes(sensors)
        judged = np.array([fault in knowledge.judged for fault in self._faults])
        self._stream = StreamEvidence(knowledge.hypotheses, knowledge.limits, judged)
        self._verdict = EvidenceVerdict(knowledge.verdict)
        self._change: StreamChange | None = None
        self._group = EvidenceGroup()
        self._opened = OpenedBy(0, -1, "", 0.0)
        self._said: object = None

    def handle(self, record: Record) -> tuple[Record, ...]:
        """The verdict, where the window that this record completes changes it."""
        return self._take(block_of(record)) if isinstance(record, Residual) else ()

    def handle_block(self, block: ResidualBlock) -> tuple[int, tuple[Record, ...]]:
        """The same of many residuals."""
        return len(block), self._take(block)

    def finish(self) -> tuple[Record, ...]:
        """Nothing is held back."""
        return ()

    def _take(self, block: ResidualBlock) -> tuple[Record, ...]:
        caused = [] if self._said else list(self._quiet(int(block.stamps_ns[0])))
        begun = 0
        for number, window in self._columns.add(block):
            caused += self._by_sensor(block, slice(begun, number + 1))
            caused += self._judge(int(block.stamps_ns[number]), window)
            begun = number + 1
        return (*caused, *self._by_sensor(block, slice(begun, len(block))))

    def _by_sensor(self, block: ResidualBlock, scans: slice) -> tuple[Record, ...]:
        """A test of a single sensor is judged at every scan."""
        first = self._sensors.take(block, scans)
        if first == len(block) or self._change is not None:
            return ()
        stamp_ns = int(block.stamps_ns[first])
        return (self._detected(stamp_ns, None), *self._followed(stamp_ns, self._open))

    def _quiet(self, stamp_ns: int) -> tuple[Record, ...]:
        """NOMINAL, where its words have changed."""
        words = OTHER if self._stream.other_unit >= 0 else NOTHING
        if words == self._said:
            return ()
        self._said = words
        return (self._verdict.without_episode(stamp_ns, Outcome.NOMINAL, words),)

    def _judge(self, stamp_ns: int, window: LawWindow) -> tuple[Record, ...]:
        """What this window changes."""
        if self._change is not None:
            self._stream.history.add(window)
            self._change.evidence.add(window)
            return self._followed(stamp_ns, self._change)
        found = self._stream.add(window)
        if found is None:
            return self._quiet(stamp_ns)
        detection = self._detected(stamp_ns, found)
        return (detection, *self._followed(stamp_ns, self._open))

    @property
    def _open(self) -> StreamChange:
        assert self._change is not None
        return self._change

    def _detected(self, stamp_ns: int, found: Found | None) -> Detection:
        """The first test beyond its limit opens the episode."""
        self._group, number = EvidenceGroup(), self._opened.number + 1
        if found is None:
            onset = self._stream.history.taken - ONSET_WINDOWS
            limit = self._knowledge.limits.onset
            self._change = StreamChange(onset, limit, self._stream.of_fault(onset))
            self._opened = OpenedBy(number, stamp_ns, self._sensors.words, limit)
            return Detection(stamp_ns, number, True, self._sensors.words, 0.0, 0.0, "sensor")
        self._change, name, limit = found.change, self._faults[found.model], found.change.limit
        words = f"{name}: {found.nats:.4g} nats, limit {limit:.4g}, evidence"
        self._opened = OpenedBy(number, stamp_ns, words, limit)
        return Detection(stamp_ns, number, True, name, found.nats, limit, "evidence, nats")

    def _followed(self, stamp_ns: int, change: StreamChange) -> tuple[Record, ...]:
        """The group, where its members are others than before; or that it was another unit."""
        weighed = change.evidence.weighed()
        if not self._sensors and self._stream.was_unit(change, weighed):
            self._change = None
            number, limit = self._opened.number, change.limit
            closed = Detection(stamp_ns, number, False, "", 0.0, limit, ANOTHER_UNIT)
            return (closed, *self._quiet(stamp_ns))
        self._group.take(self._gains(weighed), change.evidence.windows)
        what = self._opened, self._group, weighed, self._sensors.words
        decided = self._verdict.decided(*what)
        new = decided[0], tuple(self._group.shares)
        if new == self._said:
            return ()
        self._said = new
        return (self._verdict.of_group(stamp_ns, decided, *what),)

    def _gains(self, weighed: OnsetWeighed) -> dict[str, float]:
        """Nats of each fault, none that the tests of single sensors exclude."""
        gains: dict[str, float] = {}
        for fault, nats in zip(self._faults, weighed.every.tolist(), strict=True):
            gains[fault] = max(nats, gains.get(fault, -math.inf))
        by_sensors = self._sensors.faults
        if not self._sensors:
            return {fault: nats for fault, nats in gains.items() if fault not in by_sensors}
        possible = self._sensors.possible()
        by_relations = [gains[f] for f in possible if f in gains and f not in by_sensors]
        # A mode that its own test defines is not told by relations from the best of the others.
        best = max(by_relations, default=0.0)
        return {f: best if f in by_sensors else gains.get(f, best) for f in possible} or gains
