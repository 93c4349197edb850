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

"""Kalman filters side by side: stretches of recordings, each at several levels of noise.

What ``KalmanFilter`` does scan by scan for one, with one call of numpy for all: where filters are
run by the hundred, to find the noise that makes them consistent, calls are what takes the time.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from flea_diag.core.observers.driven_model import DrivenModel
from flea_diag.core.observers.kalman import KalmanFilter

Array = npt.NDArray[np.float64]


class KalmanBank:
    """Filters of S stretches at N levels of noise.

    Parameters
    ----------
    filters, models : S sequences of N
        What they are before the first scan, and what they run on. Models of a stretch differ in
        noise alone.
    """

    def __init__(
        self, filters: Sequence[Sequence[KalmanFilter]], models: Sequence[Sequence[DrivenModel]]
    ) -> None:
        self._x = np.array([[each.mean for each in row] for row in filters])
        self._P = np.array([[each.covariance for each in row] for row in filters])
        self._models = [list(row) for row in models]
        for number, row in enumerate(models):
            self.adopt(number, row)

    def adopt(self, number: int, models: Sequence[DrivenModel]) -> None:
        """Go on with other models in one stretch."""
        self._models[number] = list(models)
        own = [row[0] for row in self._models]
        self._H = np.array([each.H for each in own])[:, None]
        self._h = np.array([each.h for each in own])[:, None]
        self._R = np.array([[each.R.diagonal() for each in row] for row in self._models])
        self._missing, self._Q = b"", np.zeros_like(self._P)

    def step(self, u: Array, y: Array) -> tuple[Array, Array]:
        """Advance by one period, compare with measurements and correct by them.

        Parameters
        ----------
        u, y : shape (S, inputs), (S, channels)
            NaN = not measured.

        Returns
        -------
        Normalised innovation squared, shape (S, N), and the standard deviation of each residual,
        shape (S, N, channels), 0 where nothing was measured.

        Raises
        ------
        numpy.linalg.LinAlgError
            Rounding has destroyed a covariance.
        """
        self._predict(u)
        residual = y[:, None] - ((self._H @ self._x[..., None])[..., 0] + self._h)
        measured = np.isfinite(residual)
        # A channel that is not measured says nothing: no row of H, no residual, any noise.
        H = self._H * measured[..., None]
        r, R = np.where(measured, residual, 0.0), np.where(measured, self._R, 1.0)
        HP = H @ self._P
        S = HP @ _turned(H) + _diagonal(R)
        solved = np.linalg.solve(S, np.concatenate((HP, r[..., None]), axis=-1))
        gain = _turned(solved[..., :-1])
        self._x = self._x + (gain @ r[..., None])[..., 0]
        keep = np.eye(gain.shape[-2]) - gain @ H
        self._P = keep @ self._P @ _turned(keep) + gain @ (R[..., None] * _turned(gain))
        sigma = np.sqrt(np.diagonal(S, axis1=-2, axis2=-1))
        return (r * solved[..., -1]).sum(axis=-1), np.where(measured, sigma, 0.0)

    def _predict(self, u: Array) -> None:
        """As ``driven_model.central_differences``, the states of a stretch together."""
        count, n = self._x.shape[1:]
        steps = 1e-6 * np.maximum(1.0, np.abs(self._x))
        tried = np.repeat(self._x[..., None], 2 * n + 1, axis=-1)
        for k in range(n):
            tried[:, :, k, 1 + k] += steps[:, :, k]
            tried[:, :, k, 1 + n + k] -= steps[:, :, k]
        for number, (model, *_) in enumerate(self._models):
            states = tried[number].swapaxes(0, 1).reshape(n, -1)
            moved = model.transition(states, u[number]).reshape(n, count, -1)
            tried[number] = moved.swapaxes(0, 1)
        self._x = tried[..., 0]
        F = (tried[..., 1 : 1 + n] - tried[..., 1 + n :]) / (2.0 * steps[..., None, :])
        self._P = F @ self._P @ _turned(F) + self._noise(u)

    def _noise(self, u: Array) -> Array:
        """Process noise, shape (S, N, n, n), by which inputs are measured."""
        missing = np.isnan(u).tobytes()
        if missing != self._missing:
            self._missing = missing
            self._Q = np.array(
                [
                    [each.process_noise(row) for each in models]
                    for models, row in zip(self._models, u, strict=True)
                ]
            )
        return self._Q


def _turned(matrices: Array) -> Array:
    return matrices.swapaxes(-1, -2)


def _diagonal(values: Array) -> Array:
    """Matrices with these diagonals."""
    return values[..., None] * np.eye(values.shape[-1])
