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

"""A bank of onsets: the likelihood ratio of every fault from each of them, window by window.

An onset begins every ``ONSET_WINDOWS`` windows. The bank keeps the last ``DENSE`` of them, and
farther back ever fewer, down to ``OLDEST`` onsets ago: memory and time are constant.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from flea_diag.core.likelihood_ratio.fault_signatures import FaultSignatures
from flea_diag.core.likelihood_ratio.marginal_ratio import Sums, marginal_ratio
from flea_diag.core.likelihood_ratio.residual_window import ResidualWindow
from flea_diag.core.likelihood_ratio.white_unit import WhiteUnit
from flea_diag.core.run_law.level_noise import LevelNoise
from flea_diag.core.run_law.run_windows import WINDOW_S
from flea_diag.core.run_law.whitening import WhiteSignals

Array = npt.NDArray[np.float64]

ONSET_WINDOWS = 2
"""From onset to onset, about the smoothing of the readings."""
DENSE, OLDEST = 8, 64  # assumption: a fault that is not seen within 26 s grows
MEMORY_S = 60.0
"""Time over which evidence fades to 1/e: a unit warms up."""


class OnsetBank:
    """Sums of one stream, from its start and from every onset of the bank."""

    def __init__(
        self, noise: LevelNoise, signatures: FaultSignatures, memory_s: float = MEMORY_S
    ) -> None:
        self._signatures = signatures
        self._fade = float(np.exp(-WINDOW_S / memory_s))
        residuals, (models, sizes) = len(noise.white), signatures.shape
        differences = signatures.units.shape[2]
        self._unit = WhiteUnit(noise, signatures)
        self._faults = WhiteSignals((0, residuals, models * sizes))
        self._own = np.zeros((1 + differences,) * 2)
        self._gram = np.zeros((0, models, sizes, sizes))
        self._cross = np.zeros((0, models, sizes, 1 + differences))
        self.onsets = np.empty(0, dtype=np.int64)
        """Number of the window at which each begins."""

    @property
    def windows(self) -> int:
        """Windows taken so far."""
        return self._unit.windows

    def add(self, window: ResidualWindow, begins: bool) -> None:
        """Take one window; ``begins``: with it another onset may begin."""
        if begins and self.windows % ONSET_WINDOWS == 0 and self.windows:
            self._begin()
        elapsed_s = (self.windows - self.onsets + 0.5) * WINDOW_S
        own, gain = self._unit.step(window)
        added, growing = self._signatures.signals(window.regressors)
        white = self._faults.step(added + elapsed_s[:, None, None] * growing, gain)
        self._sum(own, white)

    def _begin(self) -> None:
        """Begin an onset, and drop those that are too dense for their age."""
        ages = (self.windows - self.onsets) // ONSET_WINDOWS
        numbers = self.onsets // ONSET_WINDOWS
        spacing = 2 ** np.maximum(np.floor(np.log2(np.maximum(ages, 1) / DENSE)) + 1, 0)
        kept = (numbers % spacing == 0) & (ages <= OLDEST)
        self._faults.keep(kept)
        self._faults.begin()
        self.onsets = np.append(self.onsets[kept], self.windows)
        self._gram = _extended(self._gram[kept])
        self._cross = _extended(self._cross[kept])

    def _sum(self, own: Array, white: Array) -> None:
        """Add the products of the innovations of one window."""
        models, sizes = self._signatures.shape
        shaped = white.reshape(*white.shape[:2], models, sizes).transpose(0, 2, 3, 1)
        crossed = np.tensordot(white, own, axes=([1], [0]))
        self._own = self._fade * self._own + own.T @ own
        self._gram = self._fade * self._gram + np.matmul(shaped, np.swapaxes(shaped, -1, -2))
        self._cross = self._fade * self._cross + crossed.reshape(self._cross.shape)

    @property
    def is_due(self) -> bool:
        """Whether the ratios are worth looking at: as often as onsets begin."""
        return self.windows % ONSET_WINDOWS == 0 and len(self.onsets) > 0

    def ratios(self) -> Array:
        """Log ratio of every model from every onset, nats, shape (onsets, models)."""
        return marginal_ratio(Sums(self._gram, self._cross, self._own), self._signatures.prior)


def _extended(sums: Array) -> Array:
    return np.concatenate((sums, np.zeros((1, *sums.shape[1:]))))
