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

"""Isolation by the evidence: the windows of the observer once more, from records alone."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from flea_diag.core.evidence.fault_evidence import OnsetWeighed, StreamHistory
from flea_diag.core.evidence.hypothesis_bank import ONSET_WINDOWS
from flea_diag.core.evidence.stream_windows import LawWindow
from flea_diag.core.isolation.detectability import unseen
from flea_diag.core.likelihood.fit import Fit, KnownErrors
from flea_diag.stages.episode import Episode
from flea_diag.stages.evidence.evidence_detection import EvidenceKnowledge
from flea_diag.stages.evidence.evidence_episode import EvidenceEpisode
from flea_diag.stages.evidence.evidence_group import TOLD_WINDOWS
from flea_diag.stages.evidence.evidence_outcome import EvidenceOutcome, best_model
from flea_diag.stages.evidence.sensor_modes import SensorModes
from flea_diag.stages.evidence.stream_evidence import of_change
from flea_diag.stages.evidence.window_stamps import WindowStamps
from flea_diag.stages.isolator.fault_episode import FaultEpisode
from flea_diag.stages.isolator.likelihood_method import (
    evidence_of_scans,
    isolation_of,
    jump_memory,
    query_of,
    require_jumps,
)
from flea_diag.stages.isolator.parameters import IsolatorParameters, Knowledge
from flea_diag.stages.isolator.quantitative_isolation import QuantitativeIsolation
from flea_diag.stages.isolator.stand_status import StandStatus
from flea_diag.stages.isolator.verdict_record import VerdictRecord
from flea_diag.wire.blocks import ResidualBlock, block_of
from flea_diag.wire.records import Residual


class EvidenceMethod:
    """Weighs every fault by the law of healthy recordings, at each window of an episode."""

    def __init__(
        self, evidence: EvidenceKnowledge, knowledge: Knowledge, parameters: IsolatorParameters,
        stand: StandStatus,
    ) -> None:  # fmt: skip
        self._e, self._k, self._p, self._stand = evidence, knowledge, parameters, stand
        self._models = evidence.hypotheses[0].signatures.models
        symptoms = knowledge.effects.residuals.symptoms
        never = unseen(knowledge.faults, evidence.visible, symptoms)
        self._faults = tuple(f for f in dict.fromkeys(evidence.faults) if f not in never)
        effects = knowledge.effects
        # Without those that only the law takes, which stand before the last two.
        self._jump_columns = np.r_[: len(effects.names) + len(effects.readings), -2:0]
        # For advice alone: how motions would part the members.
        self._quantitative = QuantitativeIsolation(knowledge.calibration, knowledge.effects)
        self._renew()

    def _renew(self) -> None:
        """A new stream begins."""
        self._columns, self._history = self._e.columns(), StreamHistory()
        self._stamps, self._sensors = WindowStamps(), SensorModes(self._e.sensors)
        self._jumps = jump_memory(self._k)
        self._begun, self._last_ns = 0, -1
        self._was_open = self._exchanged = False

    def begin(self, shared: Episode) -> FaultEpisode:
        """A new episode; without onsets it may be new, or older than all that is known."""
        self._was_open = True
        row = self._stand.other_unit
        begun = max(self._begun, self._stamps.number(row.since_ns) if row else 0)
        now = max(self._history.taken - ONSET_WINDOWS, begun)
        onsets = [self._stamps.number(ns) for ns in shared.onsets_ns] or [now, begun]
        hypotheses = self._e.hypotheses[row is not None]
        episode = EvidenceEpisode(
            shared,
            self._k.effects.residuals,
            isolation_of(self._k),
            evidence_of_scans(shared, self._k, self._quantitative, self._p.onset_s),
            query_of(shared, self._p),
            change=of_change(self._history, hypotheses, begun, list(dict.fromkeys(onsets))),
            limit=self._e.limits.before if 0 in onsets else self._e.limits.onset,
        )
        if not (shared.opened_by_vibration or shared.taken_over):
            self.evaluate(shared.detected_ns, episode)
        return episode

    def forget(self) -> None:
        """Another unit is in use: from an onset that the observer says, or with the next scan."""
        if self._stand.other_unit is None:
            self._renew()
        self._exchanged = True

    def verdict(self) -> VerdictRecord:
        """By the evidence."""
        rules = EvidenceOutcome(self._k, self._p, self._models, self._e.relations)
        return VerdictRecord(
            self._k, self._p, self._models, self._e.relations, rules, self._e.visible
        )

    def pass_by(self, record: Residual, quiet: bool) -> None:
        """Take a scan that is evaluated in no episode."""
        if quiet:
            self._close()
        for _ in self._windows(block_of(record)):
            pass

    def learn(self, block: ResidualBlock) -> None:
        """Take scans while no episode is open."""
        self._close()
        for _ in self._windows(block):
            pass

    def looks(self, episode: FaultEpisode, block: ResidualBlock) -> Iterator[int]:
        """With every window."""
        assert isinstance(episode, EvidenceEpisode)
        begun = 0
        for number, window in self._windows(block):
            episode.change.add(window)
            episode.evidence.add(block.part(slice(begun, number + 1)))
            yield number
            begun = number + 1
        episode.evidence.add(block.part(slice(begun, None)))

    def evaluate(self, stamp_ns: int, episode: FaultEpisode) -> bool:
        """Weigh every fault that may be a member."""
        assert isinstance(episode, EvidenceEpisode)
        weighed = episode.weighed = episode.change.weighed(feigned=False)
        episode.by_sensors = self._sensors.words
        fits = {fault: self._fit(fault, weighed) for fault in self._faults}
        nats = {fault: fit.log_likelihood for fault, fit in fits.items()}
        if episode.shared.opened_by_vibration:
            nats = dict.fromkeys(episode.isolation.hypotheses, 0.0) | nats
        else:
            nats = self._possible(nats)
        episode.weigh(stamp_ns, nats, fits)
        since_s = (stamp_ns - episode.shared.detected_ns) / 1e9
        if episode.change.windows >= TOLD_WINDOWS or since_s >= self._p.settle_s:
            episode.settled = True
        require_jumps(stamp_ns, episode, self._jumps, self._stand)
        return True

    def _close(self) -> None:
        """No episode is open any more: what it rested on opens no other."""
        if self._was_open:
            if not self._exchanged:
                self._begun = self._history.taken
            self._sensors = SensorModes(self._e.sensors)
            self._was_open = self._exchanged = False

    def _windows(self, block: ResidualBlock) -> Iterator[tuple[int, LawWindow]]:
        """Windows that these scans complete, each with the number of its last scan."""
        if len(block) and int(block.stamps_ns[0]) <= self._last_ns:
            self._renew()
        if len(block):
            rows = block.regressors[:, self._jump_columns]
            self._jumps.add(block.stamps_ns, rows, block.values)
        begun = 0
        for number, window in self._columns.add(block):
            self._sensors.take(block, slice(begun, number + 1))
            self._history.add(window)
            self._stamps.add(int(block.stamps_ns[number]))
            yield number, window
            begun = number + 1
        self._sensors.take(block, slice(begun, len(block)))
        self._last_ns = int(block.stamps_ns[-1]) if len(block) else self._last_ns

    def _possible(self, gains: dict[str, float]) -> dict[str, float]:
        """Evidence of faults over nothing, without those that tests of single sensors exclude."""
        by_sensors = self._sensors.faults
        if not self._sensors:
            return {fault: nats for fault, nats in gains.items() if fault not in by_sensors}
        possible = self._sensors.possible()
        by_relations = [gains[f] for f in possible if f in gains and f not in by_sensors]
        # A mode that its own test defines is not told by relations from the best of the others.
        best = max(by_relations, default=0.0)
        return {f: best if f in by_sensors else gains.get(f, best) for f in possible} or gains

    def _fit(self, fault: str, weighed: OnsetWeighed) -> Fit:
        """Evidence and sizes of a fault by the model of it that fits best."""
        best = best_model(self._models, weighed, fault)
        assert best is not None
        count = len(self._models[best].sizes)
        sizes, sigmas = (tuple(of[best, :count].tolist()) for of in (weighed.size, weighed.sigma))
        return Fit(fault, float(weighed.every[best]), sizes, KnownErrors(sigmas))
