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

"""Confidence intervals of 95 % for proportions and for rates of rare events."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise

Z_95 = 1.959963984540054


def wilson(right: int, count: int) -> tuple[float, float]:
    """Wilson's score interval of a proportion, 95 %; 0 to 1 for a count of 0.

    Source: E. B. Wilson, J. Am. Stat. Assoc. 22 (1927) 209-212.
    """
    if count == 0:
        return 0.0, 1.0
    share, z2 = right / count, Z_95**2
    middle = (share + z2 / (2 * count)) / (1 + z2 / count)
    half = Z_95 / (1 + z2 / count) * math.sqrt(share * (1 - share) / count + z2 / (4 * count**2))
    low = 0.0 if right == 0 else middle - half
    high = 1.0 if right == count else middle + half
    return low, high


def rate_interval(events: int, exposure: float) -> tuple[float, float]:
    """Exact (Garwood) interval of the rate of a Poisson process, 95 %; inf without exposure."""
    from scipy.special import gammaincinv

    if exposure <= 0.0:
        return 0.0, math.inf
    low = float(gammaincinv(events, 0.025)) if events else 0.0
    return low / exposure, float(gammaincinv(events + 1, 0.975)) / exposure


def increasing(shares: Sequence[float], weights: Sequence[float]) -> list[float]:
    """Nearest non-decreasing sequence (weighted isotonic regression, pooled adjacent violators)."""
    pools: list[list[float]] = []  # mean, weight, length
    for share, weight in zip(shares, weights, strict=True):
        pools.append([share, weight, 1])
        while len(pools) > 1 and pools[-2][0] > pools[-1][0]:
            mean, weight, length = pools.pop()
            total = pools[-1][1] + weight
            pools[-1][0] = (pools[-1][0] * pools[-1][1] + mean * weight) / total
            pools[-1][1] = total
            pools[-1][2] += length
    return [mean for mean, _, length in pools for _ in range(int(length))]


def half_point(sizes: Sequence[float], shares: Sequence[float]) -> float | None:
    """Size at which a non-decreasing proportion reaches 0.5, interpolated linearly; else None."""
    points = zip(sizes, shares, strict=True)
    for (size, share), (larger, more) in pairwise(points):
        if share < 0.5 <= more:
            return size + (0.5 - share) / (more - share) * (larger - size)
    return None
