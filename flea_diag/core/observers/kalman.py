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

"""Kalman filter, extended by linearisation where the transition is not linear.

The exact answer where the model is linear, and so the yardstick of the particle filter; in
the rest a cheap rival behind the same interface. Bar-Shalom et al. 2001, sections 5.2, 10.3.
"""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from flea_diag.core.observers.state_filter import ConsistencyMonitor, FilterModel, Innovation

Array = npt.NDArray[np.float64]


class KalmanFilter:
    """A ``Filter`` that keeps a mean and a covariance.

    Parameters
    ----------
    model
        What it runs on.
    mean, covariance : shape (n,), (n, n)
        What is known before the first scan.
    expected
        Normalised innovation squared of a channel; see ``ConsistencyMonitor``.
    """

    backend = "numpy"

    def __init__(
        self, model: FilterModel, mean: Array, covariance: Array, expected: float = 1.0
    ) -> None:
        self._x = np.array(mean, dtype=float)
        self._P = np.array(covariance, dtype=float)
        self._consistency = ConsistencyMonitor(expected=expected)
        self.diverged = False
        self.adopt(model)

    def adopt(self, model: FilterModel) -> None:
        """Go on with another model of the same states and channels."""
        self._model = model
        self._ahead = model.h

    @property
    def mean(self) -> Array:
        """Estimated states, shape (n,)."""
        return self._x.copy()

    @property
    def covariance(self) -> Array:
        """Their covariance, shape (n, n)."""
        return self._P.copy()

    def predict(self, u: Array) -> None:
        """Advance by one period under the inputs ``u``, shape (m,)."""
        self._x, F = self._model.linearised(self._x, u)
        self._P = F @ self._P @ F.T + self._model.process_noise(u)
        self._ahead = self._model.D @ np.where(np.isnan(u), 0.0, u) + self._model.h

    def update(self, y: Array, *, frozen: bool = False) -> Innovation:
        """Compare with a measurement, shape (p,), NaN = not measured, and correct by it."""
        H, R = self._model.H, self._model.R
        prediction = H @ self._x + self._ahead
        residual = np.asarray(y, dtype=float) - prediction
        measured = np.isfinite(residual)
        S = H @ self._P @ H.T + R
        r, Sm = residual[measured], S[measured][:, measured]
        nis = float(r @ np.linalg.solve(Sm, r)) if len(r) else 0.0
        sigma = np.where(measured, np.sqrt(S.diagonal()), 0.0)
        used = measured & self._model.driving if frozen else measured
        if used.any() and math.isfinite(nis):
            self._correct(residual[used], H[used], R[used][:, used], S[used][:, used])
        if not frozen:
            self.diverged = self._consistency.step(nis, len(r))
        row = (prediction, residual, sigma, self._x, (nis, math.inf))
        return Innovation(np.concatenate(row), len(H), len(r), self.diverged)

    def _correct(self, residual: Array, H: Array, R: Array, S: Array) -> None:
        gain = np.linalg.solve(S, H @ self._P).T
        self._x = self._x + gain @ residual
        # Joseph's form: remains a covariance in spite of rounding.
        keep = np.eye(len(self._x)) - gain @ H
        self._P = keep @ self._P @ keep.T + gain @ R @ gain.T
