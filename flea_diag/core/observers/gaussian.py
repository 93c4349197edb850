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
