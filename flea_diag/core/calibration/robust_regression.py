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

"""Robust linear regression with errors clustered by recording, also without each recording."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]

HUBER = 2.0
"""Residuals beyond this number of robust standard deviations lose weight."""


def robust_fit(
    A: Array, y: Array, run: npt.NDArray[np.int64], start: Array | None = None
) -> tuple[Array, Array, Array]:
    """Huber regression y = A x: solution, cluster-robust covariance, final weights.

    With ``start`` the first residuals are those of that solution, so that gross errors with
    leverage cannot dominate the fit.
    """
    x = np.linalg.lstsq(A, y, rcond=None)[0] if start is None else start
    weight = np.ones_like(y)
    for _ in range(20):
        residual = y - A @ x
        scale = 1.4826 * np.median(np.abs(residual)) + 1e-12
        weight = 1.0 / np.maximum(1.0, np.abs(residual) / (HUBER * scale))
        # Far outliers have weight 0: they come from a bad channel, not from a long tail.
        weight[np.abs(residual) > 6.0 * scale] = 0.0
        renewed = np.linalg.lstsq(A * weight[:, None], y * weight, rcond=None)[0]
        if np.allclose(renewed, x, rtol=1e-9, atol=1e-12):
            break
        x = renewed
    residual = (y - A @ x) * weight**2
    bread = np.linalg.pinv((A * weight[:, None] ** 2).T @ A)
    scores = np.array([A[run == number].T @ residual[run == number] for number in np.unique(run)])
    covariance: Array = bread @ (scores.T @ scores) @ bread
    return np.asarray(x, dtype=np.float64), covariance, weight


class FoldFits(NamedTuple):
    """Solutions without each fold in turn, and of each fold alone with its covariance.

    Shapes (folds, k), (folds, k) and (folds, k, k), at the weights of the whole fit.
    """

    without: Array
    alone: Array
    covariance: Array


def fitted_by_fold(
    A: Array, y: Array, weight: Array, fold: npt.NDArray[np.int64], folds: int, correlated: float
) -> FoldFits:
    """A robust regression without and with each fold alone, from their normal equations.

    ``correlated`` is the number of rows to one independent row. A fold that does not fix its
    solution has an infinite covariance.
    """
    weighted = A * weight[:, None] ** 2
    parts = [fold == number for number in range(folds)]
    squares = np.array([weighted[part].T @ A[part] for part in parts])
    products = np.array([weighted[part].T @ y[part] for part in parts])
    left = zip(squares.sum(axis=0) - squares, products.sum(axis=0) - products, strict=True)
    without = np.array([np.linalg.pinv(N, hermitian=True, rcond=1e-15) @ b for N, b in left])
    alone, covariance = np.zeros_like(without), np.full_like(squares, np.inf)
    for k, part in enumerate(parts):
        inverse = np.linalg.pinv(squares[k], hermitian=True, rcond=1e-15)
        alone[k] = inverse @ products[k]
        count = float(np.square(weight[part]).sum())
        fixed = np.linalg.matrix_rank(squares[k], hermitian=True) == A.shape[1]
        if fixed and count > correlated * A.shape[1]:
            apart = np.square((y[part] - A[part] @ alone[k]) * weight[part])
            covariance[k] = inverse * (correlated * float(apart.sum()) / count)
    return FoldFits(without, alone, covariance)
