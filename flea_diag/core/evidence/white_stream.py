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

"""One stream in the noise of its law: each window white, what is far out in it counting less."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from flea_diag.core.evidence.hypotheses import StreamHypotheses
from flea_diag.core.evidence.stream_windows import LawWindow
from flea_diag.core.run_law.law_noise import BOUND, left_beside
from flea_diag.core.run_law.run_windows import zeroed
from flea_diag.core.run_law.whitening import GainSequence, WhiteSignals, WindowGain

Array = npt.NDArray[np.float64]

MODEL_ERROR = 0.2
"""Share of a deviation that no model of a fault gives exactly: an assumption, 5 to 10 % that last
for a second or two."""


@dataclass(frozen=True, eq=False)
class WhiteWindow:
    """One window in white noise.

    Attributes
    ----------
    own
        [y, Psi root], shape (relations, 1 + columns).
    unit, faults
        What another unit and one unit of each size adds, in the noise of the relations but before
        the filter, shape (relations, differences) and (relations, sizes).
    growing
        What the latter add for each second since the onset.
    gain, scale
        Of the filter, and of windows that are louder, shape (relations, 1).
    errors
        Standardised errors of prediction under no fault, shape (relations,), NaN without a value.
    deviations
        The same in standard deviations of the noise alone.
    """

    own: Array
    unit: Array
    faults: Array
    growing: Array
    gain: WindowGain
    scale: Array
    errors: Array
    deviations: Array


def weight_of(errors: Array) -> Array:
    """By how much a value counts that is so many standard deviations out, (..., relations, 1)."""
    far = np.maximum(np.abs(zeroed(errors)), BOUND)
    return np.asarray(np.sqrt(BOUND / far))[..., None]


def exact_share(errors: Array) -> Array:
    """Standard deviation of the noise over that of noise and model error, (..., relations, 1)."""
    inexact = MODEL_ERROR * np.abs(zeroed(errors))
    return np.asarray(1.0 / np.maximum(inexact, 1.0))[..., None]


def standardised(white: Array, mean: Array, covariance: Array) -> Array:
    """Errors of [y, X] beside coefficients of X, in the standard deviations of a prediction."""
    return np.asarray(left_beside(white, mean) / predicted_sigma(white, covariance))


def predicted_sigma(white: Array, covariance: Array) -> Array:
    """Standard deviations of a prediction of [y, X], the noise among them."""
    x = white[..., 1:]
    return np.asarray(np.sqrt(1.0 + ((x @ covariance) * x).sum(axis=-1)))


class WhiteStream:
    """Filter and what is known so far of what the stream differs by.

    ``since_start``: windows of the stream before the first that it takes.
    """

    def __init__(self, hypotheses: StreamHypotheses, since_start: int = 0) -> None:
        self._h = hypotheses
        self._gains = GainSequence(hypotheses.noise.levels())
        count = hypotheses.own_count
        self._signals = WhiteSignals((len(hypotheses.noise.white), count))
        self.sums = np.zeros((count, count))
        """[y, Psi]' [y, Psi] of what counts, fading."""
        self._solved: tuple[Array, Array] | None = None
        self._before = since_start
        self.windows = 0

    def step(self, window: LawWindow, counts: bool = True) -> WhiteWindow:
        """Take the next window; ``counts``: whether its values are looked at."""
        h = self._h
        known = np.isfinite(window.values) & counts
        number = self._before + self.windows
        (left, psi), unit = h.own(window, number), h.of_unit(window, number)
        eta, covariance = self._known()
        rows = np.column_stack((np.where(known, left, 0.0), psi))
        loud = h.loudness(window)
        sigma = h.noise.sigma
        raw = np.where(known, standardised(rows / (loud * sigma)[:, None], eta, covariance), 0.0)
        added, growing = h.faults(window, raw)
        added = added + h.turned(window, raw, left_beside(rows, eta), eta)
        gain = self._gains.step(known)
        both = known[:, None] & known
        # Of a deviation that no model gives exactly, little is the noise of a shared sensor.
        shared = h.noise.of_others(window.signals) * np.square(exact_share(raw)[:, 0])
        apart = np.eye(len(known)) - np.where(both, shared, 0.0)
        # Each standstill holds another friction: what is common to them is the last column alone.
        scale = 1.0 / (loud * np.hypot(1.0, psi[:, -1] / sigma))[:, None]
        white = self._signals.step(apart @ rows, gain) * scale
        self.windows += 1
        deviations = np.where(known, left_beside(white, eta), np.nan)
        errors = deviations / predicted_sigma(white, covariance)
        parts = apart @ unit, apart @ added, apart @ growing
        return WhiteWindow(white, *parts, gain, scale, errors, deviations)

    def count(self, rows: Array, fade: float) -> None:
        """Add the products of rows that are weighted."""
        self.sums, self._solved = fade * self.sums + rows.T @ rows, None

    def _known(self) -> tuple[Array, Array]:
        """What the stream differs by, so far: mean and covariance of eta.

        From an onset on nothing more is learned of it.
        """
        if self._solved is None:
            inner = np.eye(len(self.sums) - 1) + self.sums[1:, 1:]
            covariance = np.asarray(np.linalg.inv(inner), dtype=np.float64)
            self._solved = covariance @ self.sums[1:, 0], covariance
        return self._solved
