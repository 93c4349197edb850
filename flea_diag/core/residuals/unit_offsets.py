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

"""Learn the offsets of this unit's current and voltage channels in the first seconds.

The zero of these channels differs between healthy units, and between two days of one unit, by
more than the faults to be found; a zero is not a fault. It is estimated in the first seconds of
a stream by Bayesian least squares on the mechanical relation (current) and on the electrical one
(voltage). The unit spread is the prior; wide priors for friction keep a jam that is present at
start from being learned as an offset. Nothing is learned afterwards.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from flea_diag.core.residuals.parameters import UNIT_PARAMETERS, UnitTolerance
from flea_diag.core.residuals.unit_difference import LEAST

Array = npt.NDArray[np.float64]

DRAG = ("coulomb_friction_n", "viscous_friction_n_s_per_m")
"""What a jam changes."""
NUISANCE = (
    *DRAG,
    "reflected_mass_kg",
    "winding_resistance_ohm",
    "back_emf_v_s_per_m",
)
"""What is estimated beside the offsets and not kept."""
REACH = 30.0
"""Their prior, in tolerances of healthy units: a jam or a short that is there from the start lies
far outside of these, and must not be learned as an offset. An assumption."""


class OffsetLearning:
    """Learns one offset, ``parameter``, from one residual and its sensitivities."""

    def __init__(self, parameter: str, tolerance: UnitTolerance) -> None:
        self._at = UNIT_PARAMETERS.index(parameter)
        wide = dict.fromkeys(NUISANCE, REACH)
        sigma = [
            wide.get(name, 1.0) * max(getattr(tolerance, name), LEAST) for name in UNIT_PARAMETERS
        ]
        self._prior = self._information = np.diag(1.0 / np.square(sigma))
        self._vector = np.zeros(len(UNIT_PARAMETERS))

    def add(self, residuals: Array, sensitivities: Array, variance: float) -> None:
        """Take n residuals, shape (n,), and sensitivities, shape (n, unit parameters).

        ``variance`` includes how many samples make one independent sample.
        """
        known = np.isfinite(residuals) & np.isfinite(sensitivities).all(axis=1)
        if not known.any():
            return
        s, r = sensitivities[known], residuals[known]
        # Accumulated in order, so that blocks and single samples give the same bits.
        outer = s[:, :, None] * s[:, None, :] / variance
        self._information = np.add.accumulate((self._information, *outer))[-1]
        # A residual r at the calibrated value wants the parameter moved by -r / (dr/dp).
        self._vector = np.subtract.accumulate((self._vector, *(s * r[:, None] / variance)))[-1]

    @property
    def shown(self) -> tuple[Array, Array]:
        """Information of the samples on the unit parameters, without the prior, and its vector."""
        return self._information - self._prior, self._vector

    def offset(self) -> tuple[float, float]:
        """Correction of the calibrated offset, and its standard deviation."""
        covariance = np.linalg.inv(self._information)
        mean = covariance @ self._vector
        return float(mean[self._at]), float(covariance[self._at, self._at] ** 0.5)
