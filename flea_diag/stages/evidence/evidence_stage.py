"""Detection and isolation by one evidence; Residual in, Detection and AmbiguityGroup out."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from flea_diag.core.evidence.fault_evidence import OnsetWeighed
from flea_diag.core.evidence.hypotheses import StreamHypotheses
from flea_diag.core.evidence.hypothesis_bank import ONSET_WINDOWS
from flea_diag.core.evidence.stream_windows import LawWindow
from flea_diag.stages.baselines.plain_verdict import plain_verdict
from flea_diag.stages.baselines.sensor_alarms import SensorAlarms
from flea_diag.stages.evidence.evidence_group import EvidenceGroup
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
    AmbiguityGroup,
    Candidate,
    Detection,
    Outcome,
    Record,
    Residual,
)

NOTHING = "no fault explains the residuals better than none"
OTHER = "another unit than the calibrated one, as healthy units differ"


@dataclass(frozen=True, eq=False)
class EvidenceKnowledge:
    """What the stage of a stand rests on."""

    hypotheses: tuple[StreamHypotheses, StreamHypotheses]
    limits: EvidenceLimits

    @property
    def faults(self) -> tuple[str, ...]:
        """Fault of each model."""
        return tuple(model.fault for model in self.hypotheses[0].signatures.models)


class EvidenceStage:
    """See the module's first line. An episode ends where all of it was another unit."""

    consumes: tuple[type, ...] = (Residual,)
    takes_blocks = True

    def __init__(
        self, knowledge: EvidenceKnowledge, columns: StreamColumns, sensors: SensorAlarms
    ) -> None:
        self._knowledge, self._faults = knowledge, knowledge.faults
        self._columns, self._sensors = columns, sensors
        # What a dead sensor reads is told by its own test alone.
        judged = np.array([fault not in sensors.faults for fault in self._faults])
        self._stream = StreamEvidence(knowledge.hypotheses, knowledge.limits, judged)
        self._change: StreamChange | None = None
        self._group = EvidenceGroup()
        self._detected_ns = -1
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
        return (plain_verdict(stamp_ns, Outcome.NOMINAL, words),)

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
        self._detected_ns, self._group = stamp_ns, EvidenceGroup()
        if found is None:
            onset = self._stream.history.taken - ONSET_WINDOWS
            limit = self._knowledge.limits.onset
            self._change = StreamChange(onset, limit, self._stream.of_fault(onset))
            return Detection(stamp_ns, 1, True, self._sensors.words, 0.0, 0.0, "sensor")
        self._change, name = found.change, self._faults[found.model]
        limit = found.change.limit
        return Detection(stamp_ns, 1, True, name, found.nats, limit, "evidence, nats")

    def _followed(self, stamp_ns: int, change: StreamChange) -> tuple[Record, ...]:
        """The group, where its members are others than before; or that it was another unit."""
        weighed = change.evidence.weighed()
        if not self._sensors and self._stream.was_unit(change, weighed):
            self._change = None
            closed = Detection(stamp_ns, 1, False, "", 0.0, change.limit, ANOTHER_UNIT)
            return (closed, *self._quiet(stamp_ns))
        self._group.take(self._gains(weighed), change.evidence.windows)
        names = tuple(self._group.shares)
        if names == self._said:
            return ()
        self._said = names
        return (self._verdict(stamp_ns, weighed),)

    def _verdict(self, stamp_ns: int, weighed: OnsetWeighed) -> AmbiguityGroup:
        nats = float(weighed.every.max())
        said = self._sensors.words or f"{nats:.1f} nats over no fault"
        members = tuple(
            Candidate(fault, "", share, said) for fault, share in self._group.shares.items()
        )
        outcome = Outcome.ISOLATED if len(members) == 1 else Outcome.INDISTINGUISHABLE
        words = f"{members[0].fault}: {said}"
        return plain_verdict(stamp_ns, outcome, words, members, self._detected_ns)

    def _gains(self, weighed: OnsetWeighed) -> dict[str, float]:
        """Nats of each fault, none that the tests of single sensors exclude."""
        gains: dict[str, float] = {}
        for fault, nats in zip(self._faults, weighed.every.tolist(), strict=True):
            gains[fault] = max(nats, gains.get(fault, -math.inf))
        if not self._sensors:
            by_sensors = self._sensors.faults
            return {fault: nats for fault, nats in gains.items() if fault not in by_sensors}
        allowed = self._sensors.allowed()
        if self._sensors.are_steps:
            # What moves no relation is not told from the best.
            best = max((gains[fault] for fault in allowed if fault in gains), default=0.0)
            return {fault: gains.get(fault, best) for fault in allowed}
        return dict.fromkeys(allowed, 0.0) or gains
