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

"""Voltages that are none of a motor: they keep their sign although the motion is reversed."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from flea_diag.core.calibration.physical_values import ONE_SIGN
from flea_diag.core.calibration.power_balance import rate_of, smoothed
from flea_diag.tools.series.series_sum import SeriesSum
from flea_diag.tools.series.series_words import COMMANDED, POSITION, SPEED, VOLTAGE

Array = npt.NDArray[np.float64]

NO_MOTOR_VOLTAGE = "it keeps its sign when the motion is reversed: no voltage of the motor"
FASTER = 0.1
"""Share of the largest speed from which on a part moves."""
EITHER_WAY = 0.05
"""Share of the readings in which a motion goes either way."""


def one_way_voltages(sources: Sequence[SeriesSum], period_s: float) -> tuple[SeriesSum, ...]:
    """Voltages of one sign in a recording with motion both ways: of a supply, or a magnitude."""
    if not any(_goes_both_ways(each, period_s) for each in sources):
        return ()
    return tuple(
        each
        for each in sources
        if each.words.quantity == VOLTAGE
        and COMMANDED not in each.words.qualifiers
        and min(_shares(each.values, 0.02)) < ONE_SIGN
    )


def _goes_both_ways(source: SeriesSum, period_s: float) -> bool:
    if COMMANDED in source.words.qualifiers or source.words.quantity not in (POSITION, SPEED):
        return False
    mean = smoothed(source.values, period_s)
    speed = rate_of(mean, period_s) if source.words.quantity == POSITION else mean
    return min(_shares(speed, FASTER)) > EITHER_WAY


def _shares(values: Array, small: float) -> tuple[float, float]:
    """Shares of readings beyond a share of the largest, below and above zero."""
    finite = values[np.isfinite(values)]
    if not len(finite):
        return 0.0, 0.0
    least = small * float(np.abs(finite).max())
    return float(np.mean(finite < -least)), float(np.mean(finite > least))
