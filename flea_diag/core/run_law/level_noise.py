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

"""What the residuals of a healthy unit are beside zero: a drifting level, and coloured noise.

For each residual, in means over windows of equal length,

    r = b + c + e,    b' = b + walk,    c' = phi c + innovation,    e white

b is a random walk: temperature, wear of the day, whatever a calibration does not hold. The shares
follow from the variogram of nominal recordings, half the mean square of r over a lag:

    gamma(lag) = white + coloured (1 - phi^lag) + walk lag / 2
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]
Flags = npt.NDArray[np.bool_]

LAGS = (1, 2, 3, 4, 6, 8, 12, 16, 24, 32, 48, 64)
"""Windows apart."""
PHIS = (0.3, 0.5, 0.7, 0.8, 0.9, 0.95)
"""Correlations of the coloured part, from window to window, that are tried."""
LEAST_SHARE = 1e-6
"""Of the variance: no part of the noise is so small that a filter divides by zero."""


@dataclass(frozen=True, eq=False)
class LevelNoise:
    """Variances of each residual, shape (residuals,); ``start``: of the level at the start."""

    white: Array
    coloured: Array
    phi: Array
    walk: Array
    start: Array

    @property
    def total(self) -> Array:
        """Variance about the level."""
        return self.white + self.coloured


def level_noise(recordings: Sequence[Array], walks: bool = True) -> LevelNoise:
    """Noise of nominal recordings, each of shape (windows, residuals), NaN where there is none.

    A residual without any value has a variance of 1: it never counts. Without ``walks`` there is
    no level: what moves slowly has been taken off.
    """
    residuals = recordings[0].shape[1]
    rows = [_of_one([entry[:, k] for entry in recordings], walks) for k in range(residuals)]
    noise = LevelNoise(*np.array(rows).T)
    return noise if walks else replace(noise, start=np.zeros(residuals))


def _of_one(columns: Sequence[Array], walks: bool) -> tuple[float, float, float, float, float]:
    known = [column[np.isfinite(column)] for column in columns]
    values = np.concatenate(known) if known else np.empty(0)
    square = float(np.square(values).mean()) if len(values) else 1.0
    lags, gamma = variogram(columns)
    if not len(lags):
        return 1.0, 0.0, 0.0, 0.0, 1.0
    floor = LEAST_SHARE * max(square, 1e-300)
    fits = [_shares(lags, gamma, phi, walks) for phi in PHIS]
    phi, ((white, coloured, walk), _) = min(
        zip(PHIS, fits, strict=True), key=lambda found: found[1][1]
    )
    means = [float(np.mean(k)) ** 2 for k in known if len(k)]
    start = float(np.mean(means)) if means else 0.0
    return max(white, floor), coloured, phi, walk, max(start, floor)


def variogram(columns: Sequence[Array]) -> tuple[Array, Array]:
    """Lags that the recordings have pairs of, and half the mean squares over them.

    Each of the columns is one residual of one recording, shape (windows,), NaN where there is none.
    """
    found = []
    for lag in LAGS:
        apart = [c[lag:] - c[:-lag] for c in columns if len(c) > lag]
        squares = np.square(np.concatenate(apart)) if apart else np.empty(0)
        squares = squares[np.isfinite(squares)]
        if len(squares):
            found.append((float(lag), 0.5 * float(squares.mean())))
    lags, gamma = np.array(found).reshape(-1, 2).T
    return lags, np.maximum(gamma, 1e-300)


def _shares(lags: Array, gamma: Array, phi: float, walks: bool) -> tuple[Array, float]:
    """White, coloured and walk of the best fit, none negative, and its relative misfit."""
    # A node that reads a calibration fits nothing, and would wait for the import.
    from scipy.optimize import nnls

    parts = np.column_stack((np.ones_like(lags), 1.0 - phi**lags, 0.5 * lags * walks))
    shares, misfit = nnls(parts / gamma[:, None], np.ones_like(gamma))
    return shares, float(misfit)
