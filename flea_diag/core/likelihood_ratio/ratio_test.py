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

"""The likelihood ratio test of one stand: its signatures, its noise and its limit.

Each fault has a limit of its own, and an equal share of the stated rate of false alarms. Were the
noise as modelled, a ratio of 1 to P would be exceeded with a probability of at most P. What a model
leaves of healthy running is not that noise: one number of each nominal recording, its largest ratio
by the noise of others, says how near it came to that fault, and the tail of these numbers
(``extreme_value``) raises the limit where it asks for it.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from flea_diag.core.calibration.limits.extreme_value import tail_level
from flea_diag.core.likelihood_ratio.fault_signatures import FaultSignatures
from flea_diag.core.likelihood_ratio.onset_bank import OnsetBank
from flea_diag.core.likelihood_ratio.residual_window import ResidualWindow
from flea_diag.core.likelihood_ratio.white_unit import WhiteUnit
from flea_diag.core.run_law.level_noise import LevelNoise, level_noise
from flea_diag.core.run_law.run_windows import WINDOW_S

Array = npt.NDArray[np.float64]
Recording = Sequence[ResidualWindow]

MARGIN = 1.4
"""Of the largest ratio of a nominal recording."""
LEAST_MAXIMA = 5
"""Recordings from which on a tail is fitted: a wrong one is too wide."""


@dataclass(frozen=True, eq=False)
class RatioTest:
    """Signatures of faults and of units, noise, and the limit of each model, nats."""

    signatures: FaultSignatures
    noise: LevelNoise
    limits_nats: Array

    def bank(self) -> OnsetBank:
        """A new bank."""
        return OnsetBank(self.noise, self.signatures)

    def largest(self, recording: Recording) -> Array:
        """Largest ratio of each model from any onset in a recording, nats, shape (models,)."""
        bank = self.bank()
        most = np.full(len(self.signatures.models), -np.inf)
        for window in recording:
            bank.add(window, begins=True)
            if bank.is_due:
                most = np.maximum(most, bank.ratios().max(axis=0))
        return most


def learned(
    signatures: FaultSignatures, recordings: Sequence[Recording], alarms_per_hour: float
) -> RatioTest:
    """Learn noise, reaches of sizes and limits from nominal recordings."""
    known = [recording for recording in recordings if len(recording)]
    halves = known[::2], known[1::2]
    maxima = [
        test.largest(recording)
        for others, judged in (halves, halves[::-1])
        for test in (_without_limits(signatures, others),)
        for recording in judged
    ]
    hours = WINDOW_S * float(np.mean([len(recording) for recording in known])) / 3600.0
    share = alarms_per_hour * hours / len(signatures.models)
    limits = np.array([_limit(column, share) for column in np.array(maxima).T])
    return replace(_without_limits(signatures, known), limits_nats=limits)


def _limit(maxima: Array, share: float) -> float:
    """Limit of one fault that this share of recordings may exceed."""
    largest = MARGIN * float(maxima.max())
    tail = tail_level(maxima, share) if len(maxima) >= LEAST_MAXIMA else largest
    return max(-math.log(share), largest, tail)


def _without_limits(signatures: FaultSignatures, recordings: Sequence[Recording]) -> RatioTest:
    """Noise of what a unit of its own leaves of each recording, and the reaches of sizes."""
    rough = level_noise([_values(recording) for recording in recordings])
    noise = level_noise([_left(recording, signatures, rough) for recording in recordings])
    noise = replace(noise, walk=np.maximum(noise.walk, signatures.least_walk))
    squares = np.mean(
        [
            (np.square(signatures.signals(window.regressors)[0]) / noise.total[:, None]).sum(axis=0)
            for recording in recordings
            for window in recording
        ],
        axis=0,
    )
    nothing = np.full(len(signatures.models), np.inf)
    return RatioTest(signatures.reaching(squares), noise, nothing)


def _values(recording: Recording) -> Array:
    return np.array([window.values for window in recording])


def _left(recording: Recording, signatures: FaultSignatures, noise: LevelNoise) -> Array:
    """Residuals of a recording without what its unit differs by, shape (windows, residuals)."""
    unit = WhiteUnit(noise, signatures)
    sums = np.zeros((1 + signatures.units.shape[2],) * 2)
    for window in recording:
        own, _ = unit.step(window)
        sums += own.T @ own
    eta = np.linalg.solve(np.eye(len(sums) - 1) + sums[1:, 1:], sums[1:, 0])
    differs = [signatures.differences(w.regressors, k) for k, w in enumerate(recording)]
    return np.asarray(_values(recording) - np.array(differs) @ eta)
