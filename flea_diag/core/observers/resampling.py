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

"""Systematic resampling and the effective sample size (Arulampalam et al. 2002, section V).

Particle i is copied N w_i times on average, and never more than one copy away from that:
with u uniform on [0, 1) its number of copies is the number of points (k + u) / N that fall
into its stretch of the cumulative weights. One uniform number serves all particles, and one
pass through the weights is enough, O(N).
"""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]
Indices = npt.NDArray[np.int64]


def normalised(log_weights: Array) -> tuple[Array, float]:
    """Weights that sum to one, and the logarithm of the sum of those given.

    Parameters
    ----------
    log_weights : shape (N,)
        Natural logarithms, of any common size; -inf is a weight of zero, and so is NaN. When
        no particle has any weight, all get the same: nothing is known of which is better.

    Returns
    -------
    weights : shape (N,)
    log_sum : float
        -inf when no particle had any weight.
    """
    largest = float(log_weights.max())
    if not math.isfinite(largest):
        log_weights = np.where(np.isnan(log_weights), -np.inf, log_weights)
        largest = float(log_weights.max())
        if not math.isfinite(largest):
            return np.full(len(log_weights), 1.0 / len(log_weights)), -math.inf
    weights = np.exp(log_weights - largest)
    total = float(weights.sum())
    weights /= total
    return weights, largest + math.log(total)


def effective_sample_size(weights: Array) -> float:
    """1 / sum w^2 of normalised weights: N if all are equal, 1 if one has all the weight."""
    return 1.0 / float(weights @ weights)


def systematic(weights: Array, uniform: float) -> Indices:
    """Index of the particle that each of N new ones copies, in rising order, shape (N,).

    Parameters
    ----------
    weights : shape (N,)
        Normalised.
    uniform : float
        In [0, 1).
    """
    n = len(weights)
    # How many of the points k + u lie below N c_i: the copies of the first i particles together.
    below = np.minimum(np.ceil(np.cumsum(weights) * n - uniform), n).astype(np.int64)
    below[-1] = n  # whatever rounding made of the last sum
    below[1:] -= below[:-1].copy()
    return np.repeat(np.arange(n), below)
