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

"""What weighs the hypotheses of an episode: a method, and that of signs and likelihoods."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Protocol

from flea_diag.core.isolation.isolation import Isolation
from flea_diag.core.isolation.missing_jump import JumpMemory
from flea_diag.stages.episode import Episode
from flea_diag.stages.isolator.episode_evaluation import EpisodeEvaluation, evaluation_ends
from flea_diag.stages.isolator.episode_evidence import EpisodeEvidence
from flea_diag.stages.isolator.fault_episode import FaultEpisode
from flea_diag.stages.isolator.feature_query import FeatureQuery
from flea_diag.stages.isolator.parameters import IsolatorParameters, Knowledge
from flea_diag.stages.isolator.quantitative_isolation import QuantitativeIsolation
from flea_diag.stages.isolator.stand_status import StandStatus
from flea_diag.stages.isolator.verdict_record import VerdictRecord
from flea_diag.wire.blocks import ResidualBlock
from flea_diag.wire.records import Residual


class Method(Protocol):
    """Makes episodes, and what differs from method to method."""

    def begin(self, shared: Episode) -> FaultEpisode:
        """A new episode."""

    def joined(self, episode: FaultEpisode) -> None:
        """The observer now detects as well what vibration had opened."""

    def forget(self) -> None:
        """The unit was exchanged for another one."""

    def verdict(self) -> VerdictRecord:
        """What makes the verdict of an episode."""

    def pass_by(self, record: Residual, quiet: bool) -> None:
        """Take a scan that is evaluated in no episode; ``quiet``: none is open."""

    def learn(self, block: ResidualBlock) -> None:
        """Take scans while no episode is open."""

    def looks(self, episode: FaultEpisode, block: ResidualBlock) -> Iterator[int]:
        """Take scans of an open episode: yields each after which it is to be evaluated."""

    def evaluate(self, stamp_ns: int, episode: FaultEpisode) -> bool:
        """Compare the evidence of an episode with its hypotheses; whether there is any."""


MethodOf = Callable[[Knowledge, IsolatorParameters, StandStatus], Method]


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
        self.quantitative = QuantitativeIsolation(knowledge.calibration, knowledge.effects)
        effects, counts = knowledge.effects, knowledge.calibration.counts
        self._jumps = JumpMemory(effects.names, effects.readings, counts)
        self._evaluation = EpisodeEvaluation(self.quantitative, parameters, stand, self._jumps)

    def begin(self, shared: Episode) -> FaultEpisode:
        """A new episode; scans from now on are not part of the baseline."""
        self.quantitative.interrupt_baseline()
        return FaultEpisode(
            shared,
            self._k.effects.residuals,
            isolation_of(self._k),
            evidence_of_scans(shared, self._k, self.quantitative, self._p.onset_s),
            query_of(shared, self._p),
        )

    def joined(self, episode: FaultEpisode) -> None:
        """Its evidence is that of all scans since the alarm."""

    def forget(self) -> None:
        """The baseline of the previous unit does not apply."""
        self.quantitative.forget()

    def verdict(self) -> VerdictRecord:
        """By the fits of fault models."""
        quantitative = self.quantitative
        return VerdictRecord(self._k, self._p, quantitative.models, quantitative.names)

    def pass_by(self, record: Residual, quiet: bool) -> None:
        """Jumps are remembered; the baseline of the unit is that of quiet scans."""
        self._jumps.add((record.stamp_ns,), (record.regressors,))
        if quiet:
            self.quantitative.learn_scan(record)

    def learn(self, block: ResidualBlock) -> None:
        """The same of many."""
        self._jumps.add(block.stamps_ns, block.regressors)
        self.quantitative.learn(block)

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
            self._jumps.add(block.stamps_ns, block.regressors)
        episode.evidence.add(block)

    def evaluate(self, stamp_ns: int, episode: FaultEpisode) -> bool:
        """Likelihoods, defining symptoms, settling; nothing before a relation has deviated."""
        self._evaluation.mark(stamp_ns, episode)
        if episode.awaits_symbols:
            return False
        self._evaluation.evaluate(stamp_ns, episode)
        return True
