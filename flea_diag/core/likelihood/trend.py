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

"""How a fault's size grows over time: a weighted straight line through its estimates.

Each estimate carries its own standard error; where the estimates scatter about the line by
more than that, the error of the slope grows with them (Birge ratio). Fewer than two times
give no slope, and a slope within two standard errors of zero shows no growth.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

SHOWN_BY = 2.0
"""Standard errors by which a slope must differ from zero to be called one."""


@dataclass(frozen=True)
class Trend:
    """Line ``level + slope * (time - middle)``; units of the size, and per second."""

    level: float
    level_sigma: float
    slope: float
    slope_sigma: float
    middle: float
    estimates: int

    @property
    def direction(self) -> str:
        """One of ``grows``, ``shrinks`` and ``no trend is shown``."""
        if math.isnan(self.slope) or abs(self.slope) <= SHOWN_BY * self.slope_sigma:
            return "no trend is shown"
        return "grows" if self.slope > 0.0 else "shrinks"


def trend(times: Sequence[float], sizes: Sequence[float], sigmas: Sequence[float]) -> Trend:
    """Fit the line; all three of the same length, at least 1, ``sigmas`` positive.

    The slope is NaN where all times are the same.
    """
    t, y = np.asarray(times, dtype=float), np.asarray(sizes, dtype=float)
    w = 1.0 / np.square(np.asarray(sigmas, dtype=float))
    middle = float(w @ t / w.sum())
    level, level_sigma = float(w @ y / w.sum()), float(1.0 / math.sqrt(w.sum()))
    spread = float(w @ np.square(t - middle))
    if len(t) < 2 or spread <= 0.0:
        return Trend(level, level_sigma, math.nan, math.nan, middle, len(t))
    slope = float(w @ ((t - middle) * y) / spread)
    scatter = float(w @ np.square(y - level - slope * (t - middle)))
    freedom = len(t) - 2
    birge = math.sqrt(max(1.0, scatter / freedom)) if freedom else 1.0
    return Trend(level, level_sigma * birge, slope, birge / math.sqrt(spread), middle, len(t))
