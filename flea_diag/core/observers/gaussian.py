"""Square roots of covariances that may be singular."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]

NOTHING = 1e-12
"""A pivot below this share of its own variance is rounding, not variance."""


def square_root(covariance: Array) -> Array:
    """Lower trapezoidal L with L L' = covariance, shape (n, rank).

    Cholesky's factor without the columns of zero pivots. Unlike eigenvectors, the result has
    no free signs, so it is the same on every machine.
    """
    left = np.array(covariance, dtype=float)
    variances = np.diag(left).copy()
    columns = []
    for k in range(len(left)):
        if left[k, k] > NOTHING * variances[k]:
            column = left[:, k] / np.sqrt(left[k, k])
            column[:k] = 0.0
            left -= np.outer(column, column)
            columns.append(column)
    return np.stack(columns, axis=1) if columns else np.zeros((len(left), 0))
