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

"""Tail of a score by extreme value theory: the level that its maximum rarely exceeds.

Samples within a recording are correlated, recordings are not. So the tail is fitted to one number
of each recording, the largest score in it, by the generalised extreme value distribution

    P(max <= s) = exp(-(1 - k (s - location) / scale)^(1/k))

with L-moments (Hosking, Wallis and Wood 1985). Its shape k is kept between that of a Gumbel
distribution, 0, and ``MOST_SHAPE``: a few dozen maxima do not show a heavier tail, nor where a
tail ends.
"""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]

EULER = 0.5772156649015329  # the mathematical constant
LEAST_MAXIMA = 20
"""Fewer maxima do not determine a tail: of eight, one that is large doubles the level."""
MOST_SHAPE = 0.3
"""A few dozen maxima do not show where a tail ends; a larger shape would end it near them."""


def l_moments(values: Array) -> tuple[float, float, float]:
    """Mean, L-scale and L-skewness of a sample."""
    ordered, n = np.sort(values), len(values)
    rank = np.arange(n)
    b0 = float(ordered.mean())
    b1 = float((rank / (n - 1.0) * ordered).mean())
    b2 = float((rank * (rank - 1.0) / ((n - 1.0) * (n - 2.0)) * ordered).mean())
    scale = 2.0 * b1 - b0
    return b0, scale, (6.0 * b2 - 6.0 * b1 + b0) / scale if scale > 0.0 else 0.0


def extreme_value(maxima: Array) -> tuple[float, float, float]:
    """Location, scale and shape k of the distribution of these maxima."""
    mean, spread, skewness = l_moments(maxima)
    c = 2.0 / (3.0 + skewness) - math.log(2.0) / math.log(3.0)
    k = min(max(7.8590 * c + 2.9554 * c * c, 0.0), MOST_SHAPE)
    if k < 1e-6:
        scale = spread / math.log(2.0)
        return mean - EULER * scale, scale, 0.0
    gamma = math.gamma(1.0 + k)
    scale = spread * k / ((1.0 - 2.0**-k) * gamma)
    return mean - scale * (1.0 - gamma) / k, scale, k


def return_level(maxima: Array, share: float) -> float:
    """Level that the given share of further maxima exceeds; NaN for too few maxima."""
    return tail_level(maxima, share) if len(maxima) >= LEAST_MAXIMA else math.nan


def tail_level(maxima: Array, share: float) -> float:
    """The same of however few, three at least: a guess, which a single large one may double."""
    location, scale, k = extreme_value(maxima)
    reduced = -math.log(-math.log1p(-min(share, 0.5)))
    return location + scale * (reduced if k == 0.0 else -math.expm1(-k * reduced) / k)
