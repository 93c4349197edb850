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

"""Detection and isolation by one statistic: the largest marginal likelihood ratio (Willsky, Jones).

Residual in, Detection and AmbiguityGroup out. Every fault from every onset is weighed against no
fault, with what the unit differs by and a drifting level integrated out; there is no other test of
a relation, no sign, no shift and no learned offset. The tests of single sensors stay: what a dead
sensor reads is no deviation of a relation. The first ratio or test beyond its limit detects, and
the group holds the faults within ``WITHIN_NATS`` of the best.
"""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from flea_diag.core.likelihood_ratio.onset_bank import ONSET_WINDOWS
from flea_diag.core.likelihood_ratio.onset_evidence import OnsetEvidence, WindowHistory
from flea_diag.core.likelihood_ratio.ratio_test import RatioTest
from flea_diag.core.likelihood_ratio.residual_window import ResidualWindow, WindowMeans
from flea_diag.stages.baselines.plain_verdict import plain_verdict
from flea_diag.stages.baselines.sensor_alarms import SensorAlarms
from flea_diag.wire.blocks import ResidualBlock, block_of
from flea_diag.wire.records import Candidate, Detection, Outcome, Record, Residual

Array = npt.NDArray[np.float64]

WITHIN_NATS = 3.5
"""As ``drop_nats`` of the isolator."""
SETTLED_WINDOWS = 60
"""Windows after a detection with which the group is final."""


class ResidualColumns:
    """The residuals of the test and their basis signals, out of records of residuals."""

    def __init__(self, names: tuple[str, ...], in_motion: frozenset[str], signals: int) -> None:
        self._names, self._signals = names, signals
        self._gated = np.array([name in in_motion for name in names], dtype=bool)

    def of(self, block: ResidualBlock) -> tuple[Array, Array]:
        """Residuals, NaN where one means nothing at rest, and basis signals."""
        values = block.values[:, [block.names.index(name) for name in self._names]]
        resting = block.regressors[:, -1] <= 0.5
        values = np.where(resting[:, None] & self._gated, np.nan, values)
        return values, block.regressors[:, : self._signals]


class LikelihoodRatioStage:
    """See the module's first lines. Latches on the first detection."""

    consumes: tuple[type, ...] = (Residual,)
    takes_blocks = True

    def __init__(
        self, test: RatioTest, columns: ResidualColumns, sensors: SensorAlarms, window_scans: int
    ) -> None:
        self._test, self._columns, self._sensors = test, columns, sensors
        self._means = WindowMeans(window_scans)
        # What a dead sensor reads is told by its own test alone.
        self._by_sensors = sensors.faults
        named = [model.fault in self._by_sensors for model in test.signatures.models]
        self._limits = np.where(named, np.inf, test.limits_nats)
        self._bank, self._history = test.bank(), WindowHistory()
        self._evidence: OnsetEvidence | None = None
        self._first: Array = np.empty(0)
        self._detected_ns = -1
        self._left = SETTLED_WINDOWS
        self._members: tuple[str, ...] = ()
        self._began = False

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
        caused: list[Record] = []
        if not self._began:
            self._began = True
            words = "no fault explains the residuals better than none"
            caused.append(plain_verdict(int(block.stamps_ns[0]), Outcome.NOMINAL, words))
        begun = 0
        for number, window in self._means.add(*self._columns.of(block)):
            if self._left:
                self._sensors.take(block, slice(begun, number + 1))
                caused += self._judge(int(block.stamps_ns[number]), window)
            begun = number + 1
        self._sensors.take(block, slice(begun, len(block)))
        return tuple(caused)

    def _judge(self, stamp_ns: int, window: ResidualWindow) -> tuple[Record, ...]:
        """What this window changes."""
        self._history.add(window)
        if self._members:
            self._left -= 1
            if self._evidence is not None:
                self._evidence.add(window)
            return self._changed(stamp_ns)
        self._bank.add(window, begins=True)
        if not (self._bank.is_due or self._sensors):
            return ()
        detection = self._detected(stamp_ns)
        return () if detection is None else (detection, *self._changed(stamp_ns))

    def _detected(self, stamp_ns: int) -> Detection | None:
        """The first test beyond its limit."""
        if not len(self._bank.onsets):
            return None
        ratios, limits = self._bank.ratios(), self._limits
        onset, model = np.unravel_index((ratios - limits).argmax(), ratios.shape)
        nats, limit = float(ratios[onset, model]), float(limits[model])
        if nats > limit:
            ago = self._bank.windows - int(self._bank.onsets[onset])
            evidence = self._history.evidence(self._test, ago)
            if evidence.windows and (evidence.ratios() > limits).any():
                self._evidence = evidence
        if self._evidence is None:
            if not self._sensors:
                return None
            self._evidence = self._history.evidence(self._test, ONSET_WINDOWS)
        self._detected_ns, self._first = stamp_ns, ratios.max(axis=0)
        name = self._sensors.words or self._test.signatures.models[model].fault
        return Detection(stamp_ns, 1, True, name, nats, limit, "likelihood ratio, nats")

    def _changed(self, stamp_ns: int) -> tuple[Record, ...]:
        """The group, where its members are others than before."""
        gains = self._gains()
        best = max(gains.values())
        near = {fault: nats - best for fault, nats in gains.items() if best - nats <= WITHIN_NATS}
        names = tuple(sorted(near, key=lambda fault: (-near[fault], fault)))
        if names == self._members:
            return ()
        self._members = names
        whole = math.fsum(map(math.exp, near.values()))
        said = self._sensors.words or f"{best:.1f} nats over no fault"
        members = tuple(Candidate(f, "", math.exp(near[f]) / whole, said) for f in names)
        outcome = Outcome.ISOLATED if len(names) == 1 else Outcome.INDISTINGUISHABLE
        words = f"{names[0]}: {said}"
        return (plain_verdict(stamp_ns, outcome, words, members, self._detected_ns),)

    def _gains(self) -> dict[str, float]:
        """Nats of each fault, none that the tests of single sensors exclude."""
        ratios = self._first
        if self._evidence is not None and self._evidence.windows:
            ratios = self._evidence.ratios()
        gains: dict[str, float] = {}
        for model, nats in zip(self._test.signatures.models, ratios.tolist(), strict=True):
            gains[model.fault] = max(nats, gains.get(model.fault, -math.inf))
        if not self._sensors:
            return {fault: nats for fault, nats in gains.items() if fault not in self._by_sensors}
        allowed = self._sensors.allowed()
        if self._sensors.are_steps:
            # What moves no relation is not told from the best.
            best = max((gains[fault] for fault in allowed if fault in gains), default=0.0)
            return {fault: gains.get(fault, best) for fault in allowed}
        return dict.fromkeys(allowed, 0.0) or gains
