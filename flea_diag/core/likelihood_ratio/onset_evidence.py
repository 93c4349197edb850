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

"""Evidence on a fault from one onset: the recent windows once more, without those about the onset.

These hold part of the fault, smoothed: to no model do they look like it. A large fault stands out
by so much that they would decide between models, and what is in them alone is no fault. Where even
the model that fits a residual best leaves more than noise, the variance of this residual is scaled
by as much since the onset (quasi-likelihood).
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable

import numpy as np
import numpy.typing as npt

from flea_diag.core.likelihood_ratio.marginal_ratio import Sums, marginal_ratio, posterior_mean
from flea_diag.core.likelihood_ratio.onset_bank import MEMORY_S, ONSET_WINDOWS
from flea_diag.core.likelihood_ratio.ratio_test import RatioTest
from flea_diag.core.likelihood_ratio.residual_window import ResidualWindow
from flea_diag.core.likelihood_ratio.white_unit import WhiteUnit
from flea_diag.core.run_law.run_windows import WINDOW_S
from flea_diag.core.run_law.whitening import WhiteSignals

Array = npt.NDArray[np.float64]


class WindowHistory:
    """The windows of the last ``MEMORY_S``."""

    def __init__(self) -> None:
        self._windows: deque[ResidualWindow] = deque(maxlen=round(MEMORY_S / WINDOW_S))

    def add(self, window: ResidualWindow) -> None:
        """Take one window."""
        self._windows.append(window)

    def evidence(self, test: RatioTest, ago: int) -> OnsetEvidence:
        """Evidence on a fault that began so many windows ago."""
        return OnsetEvidence(test, max(len(self._windows) - ago, 0), self._windows)


class OnsetEvidence:
    """White residuals, and what faults from one onset and units add to them, window by window."""

    def __init__(self, test: RatioTest, onset: int, windows: Iterable[ResidualWindow]) -> None:
        self._signatures, self._onset = test.signatures, onset
        models, sizes = test.signatures.shape
        self._unit = WhiteUnit(test.noise, test.signatures)
        self._faults = WhiteSignals((len(test.noise.white), models * sizes))
        self._own: list[Array] = []
        self._white: list[Array] = []
        for window in windows:
            self.add(window)

    def add(self, window: ResidualWindow) -> None:
        """Take one window."""
        since = self._unit.windows - self._onset
        own, gain = self._unit.step(window, counts=abs(since) >= ONSET_WINDOWS)
        self._own.append(own)
        added, growing = self._signatures.signals(window.regressors)
        effect = added + (since + 0.5) * WINDOW_S * growing if since >= 0 else 0.0 * added
        self._white.append(self._faults.step(effect, gain))

    @property
    def windows(self) -> int:
        """Windows that count since the onset."""
        return max(0, len(self._own) - self._onset - ONSET_WINDOWS)

    def ratios(self) -> Array:
        """Log ratio of every model over no fault, nats, shape (models,)."""
        own, white = np.array(self._own), np.array(self._white)
        white = white.reshape(*white.shape[:2], *self._signatures.shape)
        prior, since = self._signatures.prior, slice(self._onset + ONSET_WINDOWS, None)
        theta, eta = posterior_mean(Sums.of(own, white), prior)
        left = own[since, :, 0, None] - own[since, :, 1:] @ eta.T
        left -= np.einsum("trfi,fi->trf", white[since], theta)
        counts = np.maximum((own[since, :, 0] != 0.0).sum(axis=0), 1)
        misfit = (np.square(left).sum(axis=0) / counts[:, None]).min(axis=1)
        scale = 1.0 / np.sqrt(np.maximum(misfit, 1.0))
        own[since] *= scale[:, None]
        white[since] *= scale[:, None, None]
        return marginal_ratio(Sums.of(own, white), prior)
