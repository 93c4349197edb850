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

"""Evaluation of an episode every half second: likelihoods, defining symptoms, settling."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np
import numpy.typing as npt

from flea_diag.core.isolation.missing_jump import JumpMemory
from flea_diag.stages.isolator.fault_episode import CONCLUSIVE_S, FaultEpisode
from flea_diag.stages.isolator.parameters import IsolatorParameters
from flea_diag.stages.isolator.quantitative_isolation import QuantitativeIsolation
from flea_diag.stages.isolator.stand_status import StandStatus

Stamps = npt.NDArray[np.int64]

EVALUATE_EVERY_NS = 500_000_000  # assumption


class EpisodeEvaluation:
    """Compares the evidence of an episode with its hypotheses, at fixed times since detection."""

    def __init__(
        self,
        quantitative: QuantitativeIsolation,
        parameters: IsolatorParameters,
        stand: StandStatus,
        jumps: JumpMemory,
    ) -> None:
        self._quantitative = quantitative
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
        if followed_ns / 1e9 >= self._p.settle_s or episode.evidence.moves(self._p.settle_motion_s):
            episode.settled = True
        if episode.settled and episode.isolation.begins_with_jump:
            self._require_jumps(stamp_ns, episode)
        if episode.symbols and (episode.settled or episode.evidence.lasts(CONCLUSIVE_S)):
            episode.isolation.require(
                stamp_ns, episode.magnitudes(), episode.evidence.moved_channels(), episode.settled
            )

    def _require_jumps(self, stamp_ns: int, episode: FaultEpisode) -> None:
        """Drop errors whose jump is missing, unless they may be older than this run."""
        detected_ns = episode.shared.detected_ns
        if not self._stand.is_early(detected_ns):
            # An episode that vibration opened says nothing of when the error came up.
            until_ns = stamp_ns if episode.shared.opened_by_vibration else detected_ns
            episode.isolation.require_jumps(stamp_ns, self._jumps.largest(detected_ns, until_ns))

    def _apply_likelihoods(self, stamp_ns: int, episode: FaultEpisode) -> None:
        fits = self._quantitative.fits(episode)
        may_drop = episode.is_conclusive() or not self._p.gating
        episode.isolation.apply_likelihoods(
            stamp_ns, fits, self._p.drop_nats if may_drop else math.inf
        )


def evaluation_ends(episode: FaultEpisode, stamps_ns: Stamps) -> Iterator[int]:
    """Ends of the stretches of a block after which an evaluation is due."""
    numbers = np.rint((stamps_ns - episode.shared.detected_ns) / EVALUATE_EVERY_NS)
    yield from (np.flatnonzero(numbers != np.append(episode.evaluated, numbers[:-1])) + 1).tolist()
