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

"""White residuals of one stream, and what its unit may add to them, window by window."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from flea_diag.core.likelihood_ratio.fault_signatures import FaultSignatures
from flea_diag.core.likelihood_ratio.residual_window import ResidualWindow
from flea_diag.core.run_law.level_noise import LevelNoise
from flea_diag.core.run_law.whitening import GainSequence, WhiteSignals, WindowGain

Array = npt.NDArray[np.float64]


class WhiteUnit:
    """The same filter for residuals and for what units differ by."""

    def __init__(self, noise: LevelNoise, signatures: FaultSignatures) -> None:
        self._signatures = signatures
        self._gains = GainSequence(noise)
        self._signals = WhiteSignals((len(noise.white), 1 + signatures.units.shape[2]))
        self.windows = 0
        """Windows taken so far."""

    def step(self, window: ResidualWindow, counts: bool = True) -> tuple[Array, WindowGain]:
        """[y, Psi] of the next window, shape (residuals, 1 + differences), and the gains.

        ``counts``: whether its residuals are looked at; else all are as missing.
        """
        known = np.isfinite(window.values) & counts
        gain = self._gains.step(known)
        differs = self._signatures.differences(window.regressors, self.windows)
        values = np.where(known, window.values, 0.0)
        self.windows += 1
        return self._signals.step(np.column_stack((values, differs)), gain), gain
