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

"""Advice on a group that is not isolated: stand tests that would isolate it further."""

from __future__ import annotations

from collections.abc import Collection, Sequence

from flea_diag.core.choice.next_test import (
    LikelihoodTest,
    StandTest,
    Suspect,
    feature_tests,
    motion_tests,
    next_tests,
)
from flea_diag.core.choice.planned_motion import motions_within, planned
from flea_diag.core.isolation.weights import Weights
from flea_diag.core.likelihood.fault_models import FaultModel
from flea_diag.stages.isolator.fault_episode import FaultEpisode
from flea_diag.stages.isolator.parameters import IsolatorParameters, Knowledge
from flea_diag.wire.records import NextTest

MOST_SUSPECTS = 6
"""Largest group for which motions are evaluated: the effort grows with its square."""
MOST_TESTS = 6  # assumption: what an operator reads


class Advice:
    """Ranks the tests that would isolate the group of an episode further."""

    def __init__(
        self,
        knowledge: Knowledge,
        parameters: IsolatorParameters,
        models: Sequence[FaultModel],
    ) -> None:
        self._k = knowledge
        calibration = knowledge.calibration
        weights = Weights.of(calibration, knowledge.effects)
        self._test = LikelihoodTest(
            models, weights.sigma, weights.correlation, weights.tolerances, parameters.drop_nats
        )
        self._motions = motions_within(
            knowledge.effects.residuals, calibration.envelope, calibration.period_s
        )
        for motion in self._motions:  # cached now, so that no verdict waits for it
            planned(knowledge.effects, knowledge.calibration.parameters, motion)

    def tests(
        self, stamp_ns: int, episode: FaultEpisode, axes: Collection[str]
    ) -> tuple[NextTest, ...]:
        """Tests that would split the group, highest gain per second first."""
        suspects = [Suspect(h.name, h.probability, h.fit) for h in episode.isolation.alive()]
        if len(suspects) < 2:
            return ()
        features, sensors = feature_tests(suspects, self._k.features, axes, episode.query.computed)
        motions: tuple[StandTest, ...] = ()
        if len(suspects) <= MOST_SUSPECTS and episode.evidence.scans:
            motions = motion_tests(
                suspects,
                episode.evidence.equations,
                self._test,
                self._k.effects,
                self._k.calibration.parameters,
                (stamp_ns - episode.shared.detected_ns) / 1e9,
                self._motions,
            )
        ranked = next_tests(suspects, motions, features, sensors)[:MOST_TESTS]
        return tuple(
            NextTest(
                test.kind,
                test.what,
                test.seconds,
                test.expected_size,
                tuple(f"{one} / {two}" for one, two in test.splits),
            )
            for test in ranked
        )
