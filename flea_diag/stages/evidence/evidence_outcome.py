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

"""Outcome by the evidence: whether the most likely faults fit; another unit is no fault."""

from __future__ import annotations

from collections.abc import Sequence

from flea_diag.core.evidence.fault_evidence import OnsetWeighed
from flea_diag.core.evidence.goodness import contradicted
from flea_diag.core.isolation.hypothesis import Hypothesis
from flea_diag.core.likelihood.fault_models import FaultModel
from flea_diag.stages.evidence.evidence_episode import EvidenceEpisode
from flea_diag.stages.isolator.fault_episode import FaultEpisode
from flea_diag.stages.isolator.outcome import Decision, OutcomeRules
from flea_diag.stages.isolator.parameters import IsolatorParameters, Knowledge
from flea_diag.stages.isolator.stand_status import StandStatus
from flea_diag.wire.records import ChannelQuality, Outcome


class EvidenceOutcome(OutcomeRules):
    """Rules of the outcome; ``models`` and ``relations`` are those of the law."""

    def __init__(
        self, knowledge: Knowledge, parameters: IsolatorParameters,
        models: Sequence[FaultModel], relations: Sequence[str],
    ) -> None:  # fmt: skip
        super().__init__(knowledge, parameters, models, relations)
        self._models, self._relations = models, relations

    def _contradiction(self, episode: FaultEpisode, alive: list[Hypothesis]) -> str | None:
        """What the most likely fault leaves, if none that is left fits; None: one does."""
        assert isinstance(episode, EvidenceEpisode)
        weighed, words = episode.weighed, ""
        if weighed is None or episode.by_sensors or episode.shared.opened_by_vibration:
            return None
        for hypothesis in alive:
            best = best_model(self._models, weighed, hypothesis.name)
            if best is None:
                return None
            is_reading = bool(hypothesis.fault.channel)
            found = contradicted(weighed, best, is_reading, episode.limit)
            if found is None:
                return None
            relation = self._relations[found.relation]
            words = words or f": {relation} keeps {found.scatter:.1f} times its healthy scatter"
        return words

    def _is_of_unit(self, alive: list[Hypothesis]) -> bool:
        """What differs from unit to unit has been weighed beside every fault."""
        return False

    def unit(self, stand: StandStatus) -> ChannelQuality | None:
        """Another healthy unit is said as soon as it is known."""
        return stand.other_unit

    def _quiet(self, stamp_ns: int, stand: StandStatus) -> Decision:
        """Another healthy unit is said."""
        outcome, words = super()._quiet(stamp_ns, stand)
        if outcome is not Outcome.NOMINAL or stand.other_unit is None:
            return outcome, words
        return outcome, f"{words}; {stand.other_unit.reason}"


def best_model(models: Sequence[FaultModel], weighed: OnsetWeighed, fault: str) -> int | None:
    """Number of the model of a fault that fits best; None: it has no model."""
    places = [k for k, model in enumerate(models) if model.fault == fault]
    return max(places, key=lambda k: float(weighed.every[k])) if places else None
