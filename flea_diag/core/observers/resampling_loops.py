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

"""Weights of a particle cloud and their resampling as loops, for numba; see ``resampling``.

These functions call nothing but each other, because this package runs without numba too.
"""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]

LN2 = math.log(2.0)
INVERSE_LN2 = 1.0 / LN2
INVERSE_FACTORIALS = tuple(1.0 / math.factorial(k) for k in range(13))


def exp_loops(v: Array, found: Array) -> None:
    """Exponentials of ``v``, -700 or more and not positive.

    exp(v) = 2^k exp(r), |r| <= ln(2)/2, by Taylor's series to the last bit: this vectorises, a
    call of exp() does not.
    """
    power = np.empty(len(v), np.int64)
    scale = power.view(np.float64)
    for i in range(len(v)):
        k = math.floor(v[i] * INVERSE_LN2 + 0.5)
        power[i] = (np.int64(k) + 1023) << 52
        r = v[i] - k * LN2
        series = 1.0 / 6227020800.0
        for degree in range(13, 0, -1):
            series = series * r + INVERSE_FACTORIALS[degree - 1]
        found[i] = series
    for i in range(len(v)):
        found[i] *= scale[i]


def mean_loops(x: Array, weights: Array, mean: Array) -> None:
    """Weighted mean of the particles."""
    for c in range(len(x)):
        s = 0.0
        for i in range(len(weights)):
            s += x[c, i] * weights[i]
        mean[c] = s


def likelihood_loops(log_weights: Array, weights: Array, fit: Array) -> float:
    """Add log likelihoods -``fit`` / 2 and take weights relative to the largest.

    Returns the largest logarithm; -inf or NaN: no particle fits, all weights are one. ``fit``
    is used up.
    """
    count = len(weights)
    largest = -math.inf
    for i in range(count):
        log_weights[i] -= 0.5 * fit[i]
        if log_weights[i] > largest:
            largest = log_weights[i]
    good = math.isfinite(largest)
    for i in range(count):
        v = log_weights[i] - largest if good else 0.0
        fit[i] = v if v > -700.0 else -700.0  # below e^-700, or NaN, counts as nothing
    exp_loops(fit, weights)
    return largest


def normalisation_loops(log_weights: Array, weights: Array, largest: float, total: float) -> None:
    """Divide the weights of ``likelihood_loops`` by their sum ``total``."""
    count = len(weights)
    good = math.isfinite(largest)
    lost = largest + math.log(total) if good else 0.0
    share = 1.0 / total
    for i in range(count):
        weights[i] *= share
        log_weights[i] = log_weights[i] - lost if good else -math.log(count)


def resampling_loops(x: Array, log_weights: Array, weights: Array, uniform: float) -> Array:
    """Particles resampled systematically; the weights become equal in place."""
    n, count = x.shape
    # How many particles have all their copies before place k: the index of the one at k.
    done = np.zeros(count + 1, np.int64)
    reached = 0.0
    for i in range(count - 1):
        reached += weights[i] * count
        done[min(count, math.ceil(reached - uniform))] += 1
    copies = np.empty((n, count))
    index = 0
    for k in range(count):
        index += done[k]
        done[k] = index
    for c in range(n):
        for k in range(count):
            copies[c, k] = x[c, done[k]]
    weights[:] = 1.0 / count
    log_weights[:] = -math.log(count)
    return copies
