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

"""Whether a fault's size grows over time: a straight line by generalised least squares.

The error of the unit, which all recordings share, is in the level of the line and hardly in its
slope. Where sizes scatter about the line by more or less than stated, the error of the slope goes
with them. Fewer than two times give no slope, and a slope within two standard errors of zero shows
no growth.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from flea_diag.core.prognosis.size_series import SizeSeries, fitted, scatter

SHOWN_BY = 2.0
"""Standard errors by which a slope must differ from zero to be called one."""
MOST_FURTHER = 50
"""Recordings more than which are not foretold."""


@dataclass(frozen=True)
class Trend:
    """Line ``level + slope * (time - middle)``; units of the size, and per second.

    ``scale`` is by how much the recordings scatter about it, in their stated own errors.
    """

    level: float
    level_sigma: float
    slope: float
    slope_sigma: float
    middle: float
    estimates: int
    scale: float = 1.0

    @property
    def direction(self) -> str:
        """One of ``grows``, ``shrinks`` and ``no trend is shown``."""
        if math.isnan(self.slope) or abs(self.slope) <= SHOWN_BY * self.slope_sigma:
            return "no trend is shown"
        return "grows" if self.slope > 0.0 else "shrinks"


def trend(series: SizeSeries) -> Trend:
    """Fit the line; the slope is NaN where all times are the same."""
    weight = 1.0 / np.square(series.own)
    middle = float(weight @ series.times / weight.sum())
    since = series.times - middle
    count = len(series)
    if not (count > 1 and since.any()):
        (level,), covariance = fitted(series, np.ones((count, 1)))
        sigma = math.sqrt(covariance[0, 0])
        return Trend(float(level), sigma, math.nan, math.nan, middle, count)
    design = np.stack((np.ones(count), since), axis=1)
    scale = scatter(series, design)
    (level, slope), covariance = fitted(series, design, scale)
    level_sigma, slope_sigma = np.sqrt(np.diagonal(covariance)).tolist()
    return Trend(float(level), level_sigma, float(slope), slope_sigma, middle, count, scale)


def further_needed(series: SizeSeries, line: Trend) -> int | None:
    """Recordings more, as far apart as so far, after which this slope would be shown.

    None where it takes more than ``MOST_FURTHER`` of them or there is no slope at all; 0: it is.
    """
    if math.isnan(line.slope) or line.slope == 0.0:
        return None
    apart = float(series.times[-1] - series.times[0]) / (len(series) - 1)
    own = line.scale * float(np.median(series.own))
    for more in range(MOST_FURTHER + 1):
        times = np.append(series.times, series.times[-1] + apart * np.arange(1, more + 1))
        sigma = own / math.sqrt(float(np.square(times - times.mean()).sum()))
        shown = replace(
            line, slope_sigma=min(sigma, line.slope_sigma) if more else line.slope_sigma
        )
        if shown.direction != "no trend is shown":
            return more
    return None
