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

"""When and where a fault comes: how often, for how long, how regularly, at which place."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]

LEAST_TIMES = 6
"""Comings before anything is said of their rhythm or their place."""
REGULAR = 0.9
"""Share of intervals that a rhythm explains."""
SLACK_S = 0.25
"""By how much the time of a coming may be off: a window, and what smoothing adds."""
SURE = 1.63
"""Of Kolmogorov's statistic: 1 % of places drawn where the machine was anyway are beyond."""


PROBABLE = 0.975
"""That it came no more often than is said: the upper end of an interval of 95 %."""


def most_times(count: int, told_s: float, unseen_s: float) -> int:
    """How often it may have come, with what it did while it could not have shown.

    A fault that comes at random came there as often in proportion: with Jeffreys' prior of its rate
    that has a negative binomial distribution, of ``count + 1/2`` and ``told_s`` of all the time.
    One with a rhythm scatters less.
    """
    from scipy.special import betainc  # slow to import, and few faults come and go

    share = told_s / (told_s + unseen_s) if told_s > 0.0 else 1.0
    more = 0
    while share < 1.0 and betainc(count + 0.5, more + 1.0, share) < PROBABLE:
        more += 1
    return count + more


def rhythm(times_s: Array) -> float:
    """Period (s) in which a fault comes, some of them left out; NaN where there is none.

    A period is told where it is by far longer than the times are off.
    """
    apart = np.diff(times_s)
    if len(times_s) < LEAST_TIMES:
        return math.nan
    period = float(np.median(apart))
    if period < 6.0 * SLACK_S:
        return math.nan
    whole = np.maximum(np.rint(apart / period), 1.0)
    period = float(apart.sum() / whole.sum())
    regular = np.abs(apart - whole * period) <= SLACK_S
    return period if regular.mean() >= REGULAR else math.nan


def gathered(came: Array, everywhere: Array) -> float:
    """Place at which a fault comes; NaN where it comes wherever the machine happens to be.

    Kolmogorov's test of the places at which it came against all in which it would have shown.
    """
    came, everywhere = (np.sort(each[np.isfinite(each)]) for each in (came, everywhere))
    count = len(came)
    if count < LEAST_TIMES or not len(everywhere):
        return math.nan
    below = np.searchsorted(everywhere, came, side="right") / len(everywhere)
    steps = np.arange(count + 1) / count
    farthest = max(float((steps[1:] - below).max()), float((below - steps[:-1]).max()))
    return float(np.median(came)) if farthest * math.sqrt(count) > SURE else math.nan
