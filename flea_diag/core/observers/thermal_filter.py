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

"""Kalman filter of one slow store, driven by what supplies it and by its measured neighbours.

    x' = supply + sum of exchange * (neighbour - x)

A temperature hardly wanders by itself: particles would all descend from one first guess, and
given the heat the store is linear. So the observer samples the motion and keeps each
temperature as one Gaussian (Rao-Blackwellisation, with the heat of the mean current).
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]

START_K = 10.0
"""Standard deviation of the first reading: thermocouples begin with a spike now and then."""
ESTIMATE, VARIANCE, PERIOD, WALK, READING, EXCHANGE = range(6)
"""Places in a filter: what it estimates, degC and K^2, its period and variances; then a share for
each reading, by which the store follows it in one period."""


def thermal_filter(
    period_s: float, walk_k: float, reading_k: float, rates: npt.ArrayLike = ()
) -> Array:
    """A filter before its first reading.

    Parameters
    ----------
    walk_k, reading_k
        Standard deviations of what one scan adds unknown, and of one reading.
    rates
        Exchange with each of the readings of a scan, 1/s.
    """
    start = [math.nan, START_K**2, period_s, walk_k**2, reading_k**2]
    return np.array([*start, *(period_s * np.asarray(rates, dtype=float))])


def heat_loops(store: Any, readings: Any, own: int, supply: float, frozen: bool, told: Any) -> None:
    """Advance by one scan; numba compiles these lines, too.

    ``told`` is filled with prediction, residual and sigma, NaN before the first reading, the
    residual also without a reading; and with the estimate after the scan.
    """
    measured = readings[own]
    told[0] = told[1] = told[2] = math.nan
    if math.isnan(store[ESTIMATE]):
        store[ESTIMATE] = told[3] = measured
        return
    before = store[ESTIMATE]
    if not math.isnan(supply):
        before += store[PERIOD] * supply
    prediction = before
    for k in range(len(store) - EXCHANGE):
        if not math.isnan(readings[k]):
            prediction -= store[EXCHANGE + k] * (before - readings[k])
    variance = store[VARIANCE] + store[WALK]
    total = variance + store[READING]
    told[0], told[1], told[2] = prediction, measured - prediction, math.sqrt(total)
    store[ESTIMATE], store[VARIANCE] = prediction, variance
    if not frozen and not math.isnan(measured):
        gain = variance / total
        store[ESTIMATE] += gain * told[1]
        store[VARIANCE] -= gain * variance
    told[3] = store[ESTIMATE]
