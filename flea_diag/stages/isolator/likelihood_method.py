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

"""Signs and likelihoods: what weighs the hypotheses of an episode, every half second.

Likelihoods of fits, defining symptoms, settling; between episodes the baseline of the unit.
"""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np
import numpy.typing as npt

from flea_diag.core.isolation.isolation import Isolation
from flea_diag.core.isolation.missing_jump import JumpMemory
from flea_diag.stages.episode import Episode
from flea_diag.stages.isolator.episode_evidence import EpisodeEvidence
from flea_diag.stages.isolator.fault_episode import CONCLUSIVE_S, FaultEpisode
from flea_diag.stages.isolator.feature_query import FeatureQuery
from flea_diag.stages.isolator.pairs.second_fault_search import SecondFaultSearch
from flea_diag.stages.isolator.parameters import IsolatorParameters, Knowledge
from flea_diag.stages.isolator.quantitative_isolation import QuantitativeIsolation
from flea_diag.stages.isolator.stand_status import StandStatus
from flea_diag.stages.isolator.verdict_record import VerdictRecord
from flea_diag.stages.judgement.tested import tested_names
from flea_diag.wire.blocks import ResidualBlock
from flea_diag.wire.records import Residual

Stamps = npt.NDArray[np.int64]

EVALUATE_EVERY_NS = 500_000_000  # the shortest window of a test: nothing is new before


class EpisodeEvaluation:
    """Compares the evidence of an episode with its hypotheses, at fixed times since detection."""

    def __init__(
        self,
        quantitative: QuantitativeIsolation,
        parameters: IsolatorParameters,
        stand: StandStatus,
        jumps: JumpMemory,
        second: SecondFaultSearch,
    ) -> None:
        self._quantitative = quantitative
        self._second = second
        self._jumps = jumps
        self._p = parameters
        self._stand = stand

    def mark(self, stamp_ns: int, episode: FaultEpisode) -> None:
        """Record that another half second has passed."""
        episode.evaluated = round((stamp_ns - episode.shared.detected_ns) / EVALUATE_EVERY_NS)

    def evaluate(self, stamp_ns: int, episode: FaultEpisode) -> None:
        """Drop contradicted hypotheses; settle after enough scans in motion, or enough time."""
        if self._p.likelihood:
            self._apply_likelihoods(stamp_ns, episode)
        # An isolator that was started later has no evidence from before its first scan.
        followed_ns = stamp_ns - max(episode.shared.detected_ns, self._stand.first_ns)
        followed_s = followed_ns / 1e9
        if followed_s >= self._p.settle_s or episode.evidence.moves(self._p.settle_motion_s):
            episode.settled = True
        require_jumps(stamp_ns, episode, self._jumps, self._stand)
        if episode.symbols and (episode.settled or episode.evidence.lasts(CONCLUSIVE_S)):
            episode.isolation.require(
                stamp_ns, episode.magnitudes(), episode.evidence.moved_channels(),
                episode.settled, followed_s,
            )  # fmt: skip
        if self._p.likelihood:
            self._second.look(stamp_ns, episode)

    def _apply_likelihoods(self, stamp_ns: int, episode: FaultEpisode) -> None:
        fits = self._quantitative.fits(episode)
        may_drop = episode.is_conclusive() or not self._p.gating
        episode.isolation.apply_likelihoods(
            stamp_ns, fits, self._p.drop_nats if may_drop else math.inf
        )


def require_jumps(
    stamp_ns: int, episode: FaultEpisode, jumps: JumpMemory, stand: StandStatus
) -> None:
    """Drop errors whose jump is missing once settled, unless they may be older than this run."""
    detected_ns = episode.shared.detected_ns
    begins = episode.settled and episode.isolation.begins_with_jump
    if begins and not stand.is_early(detected_ns):
        # An episode that vibration opened says nothing of when the error came up.
        until_ns = stamp_ns if episode.shared.opened_by_vibration else detected_ns
        seen = jumps.largest(detected_ns, until_ns, episode.told_by)
        episode.isolation.require_jumps(stamp_ns, seen)


def jump_memory(knowledge: Knowledge) -> JumpMemory:
    """The jumps of the readings of a stand, none of them known yet."""
    effects, calibration = knowledge.effects, knowledge.calibration
    tested = tested_names(effects.residuals, calibration)
    return JumpMemory(effects.names, effects.readings, tested, calibration.counts)


def evaluation_ends(episode: FaultEpisode, stamps_ns: Stamps) -> Iterator[int]:
    """Ends of the stretches of a block after which an evaluation is due."""
    numbers = np.rint((stamps_ns - episode.shared.detected_ns) / EVALUATE_EVERY_NS)
    yield from (np.flatnonzero(numbers != np.append(episode.evaluated, numbers[:-1])) + 1).tolist()


def query_of(shared: Episode, parameters: IsolatorParameters) -> FeatureQuery:
    """Feature requests of an episode."""
    window_ns = round(parameters.feature_window_s * 1e9)
    return FeatureQuery(shared.detected_ns, window_ns, parameters.feature_windows)


def isolation_of(knowledge: Knowledge) -> Isolation:
    """Every fault of the catalogue as a hypothesis."""
    return Isolation(knowledge.faults, knowledge.signatures, knowledge.symptoms)


def evidence_of_scans(
    shared: Episode, knowledge: Knowledge, quantitative: QuantitativeIsolation, onset_s: float
) -> EpisodeEvidence:
    """Normal equations of the scans of an episode."""
    calibration = knowledge.calibration
    return EpisodeEvidence(
        quantitative.names,
        quantitative.basis,
        quantitative.acting,
        shared.detected_ns,
        round(onset_s * 1e9),
        calibration.parameters,
        knowledge.effects.residuals,
        calibration.counts,
    )


class LikelihoodMethod:
    """Signs drop hypotheses, and likelihoods of fits every half second."""

    def __init__(
        self, knowledge: Knowledge, parameters: IsolatorParameters, stand: StandStatus
    ) -> None:
        self._k, self._p = knowledge, parameters
        self._quantitative = QuantitativeIsolation(knowledge.calibration, knowledge.effects)
        self._jumps = jump_memory(knowledge)
        second = SecondFaultSearch(knowledge, parameters, self._quantitative, stand, self._jumps)
        self._evaluation = EpisodeEvaluation(
            self._quantitative, parameters, stand, self._jumps, second
        )

    def begin(self, shared: Episode) -> FaultEpisode:
        """A new episode; scans from now on are not part of the baseline."""
        self._quantitative.interrupt_baseline()
        return FaultEpisode(
            shared,
            self._k.effects.residuals,
            isolation_of(self._k),
            evidence_of_scans(shared, self._k, self._quantitative, self._p.onset_s),
            query_of(shared, self._p),
        )

    def forget(self) -> None:
        """The baseline of the previous unit does not apply."""
        self._quantitative.forget()

    def verdict(self) -> VerdictRecord:
        """By the fits of fault models."""
        known = self._quantitative
        share = known.weights.run_share
        return VerdictRecord(self._k, self._p, known.models, known.names, run_share=share)

    def pass_by(self, record: Residual, quiet: bool) -> None:
        """Jumps are remembered; the baseline of the unit is that of quiet scans."""
        self._jumps.add_scan(record.stamp_ns, record.regressors, record.values)
        if quiet:
            self._quantitative.learn_scan(record)

    def learn(self, block: ResidualBlock) -> None:
        """The same of many."""
        self._jumps.add(block.stamps_ns, block.regressors, block.values)
        self._quantitative.learn(block)

    def looks(self, episode: FaultEpisode, block: ResidualBlock) -> Iterator[int]:
        """Every half second since the detection."""
        start = 0
        for end in evaluation_ends(episode, block.stamps_ns):
            self._add(episode, block.part(slice(start, end)))
            yield end - 1
            start = end
        self._add(episode, block.part(slice(start, None)))

    def _add(self, episode: FaultEpisode, block: ResidualBlock) -> None:
        """Add scans, possibly none, to what is known of an episode."""
        if len(block):
            self._jumps.add(block.stamps_ns, block.regressors, block.values)
        episode.evidence.add(block)

    def evaluate(self, stamp_ns: int, episode: FaultEpisode) -> bool:
        """Likelihoods, defining symptoms, settling; nothing before a relation has deviated."""
        self._evaluation.mark(stamp_ns, episode)
        if episode.recurrence is not None or episode.awaits_symbols:
            return False
        self._evaluation.evaluate(stamp_ns, episode)
        return True
