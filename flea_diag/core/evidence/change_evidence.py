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

"""Evidence on a fault whose onset is known to a few windows only.

An onset that is put too early makes a drift of what is a bias. So each fault is weighed from each
of a few onsets, and counts by their mean.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from flea_diag.core.evidence.fault_evidence import FaultEvidence, OnsetWeighed
from flea_diag.core.evidence.stream_windows import LawWindow

Array = npt.NDArray[np.float64]


class ChangeEvidence:
    """The same of every onset that may be the true one, the most likely first."""

    def __init__(self, onsets: Sequence[FaultEvidence]) -> None:
        self._onsets = tuple(onsets)

    def add(self, window: LawWindow) -> None:
        """Take one window."""
        for evidence in self._onsets:
            evidence.add(window)

    @property
    def windows(self) -> float:
        """Windows that count since the last of the onsets."""
        return min(evidence.windows for evidence in self._onsets)

    @property
    def told(self) -> float:
        """Windows by which explanations are told apart: in one direction of motion, one."""
        return self.windows if self.first.goes_both_ways else 1.0

    @property
    def first(self) -> FaultEvidence:
        """Of the most likely onset."""
        return self._onsets[0]

    def weighed(self, feigned: bool = True) -> OnsetWeighed:
        """Mean over the onsets; size and misfit of a model are those of the onset it fits best."""
        every = [evidence.weighed(feigned) for evidence in self._onsets]
        if len(every) == 1:
            return every[0]
        best = np.argmax([one.alone for one in every], axis=0)
        models = np.arange(len(best))
        first, unit = every[0], float(_mean([one.unit for one in every]))
        return OnsetWeighed(
            _mean([one.alone for one in every]),
            # Fault and unit came at one time.
            _mean([one.unit + one.with_unit for one in every]) - unit,
            unit,
            _mean([one.healthy for one in every]),
            _mean([one.healthy_unit for one in every]),
            np.stack([one.size for one in every])[best, models],
            np.stack([one.sigma for one in every])[best, models],
            np.stack([one.left for one in every])[best, :, models].T,
            first.shown,
            first.windows,
        )


def _mean(nats: Sequence[npt.ArrayLike]) -> Array:
    """Of likelihoods, in nats."""
    return np.asarray(np.logaddexp.reduce(np.array(nats), axis=0) - math.log(len(nats)))
