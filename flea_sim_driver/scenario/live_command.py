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

"""A command that comes while the stand runs, as over the data bus of an aircraft.

What comes is followed at no more than the speed of the machine and behind a lag, so that a bus of
any rate makes a motion without jumps. Between two values, and for as long as none comes, the last
one is held.
"""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from flea_sim_driver.plant.plant import STEP_S

Array = npt.NDArray[np.float64]
FOLLOWS_RAD_S = 20.0
"""Bandwidth of the lag: what a bus of 10 Hz sends becomes a smooth motion."""


def lag(bandwidth_rad_s: float, step_s: float) -> tuple[list[float], list[float]]:
    """Two equal lags in a row as a filter: numerator and denominator for ``lfilter``."""
    kept = math.exp(-bandwidth_rad_s * step_s)
    return [(1.0 - kept) ** 2], [1.0, -2.0 * kept, kept**2]


_LAG = lag(FOLLOWS_RAD_S, STEP_S)


class FollowedValue:
    """One value of the bus within its limits; ``rate`` is its greatest change in a second."""

    def __init__(self, start: float, low: float, high: float, rate: float) -> None:
        from scipy.signal import lfilter  # a second to import, so not at the first value

        self._filter = lfilter
        self._low, self._high, self._step = low, high, rate * STEP_S
        self._wanted = self._at = start
        self._state = start * np.array([1.0 - _LAG[0][0], -_LAG[1][2]])
        self.refused = 0
        """Values that were no number within the limits."""

    def take(self, value: float) -> bool:
        """Follow this from now on; False: it is outside the limits, and the last one is held."""
        if not self._low <= value <= self._high:  # nor where it is NaN
            self.refused += 1
            return False
        self._wanted = value
        return True

    def block(self, steps: int) -> Array:
        """Values of the next steps of the plant, shape (steps,)."""
        way = np.clip(
            self._wanted - self._at, -self._step * np.arange(1, steps + 1),
            self._step * np.arange(1, steps + 1),
        )  # fmt: skip
        followed = self._at + way
        self._at = float(followed[-1])
        smooth, self._state = self._filter(*_LAG, followed, zi=self._state)
        return np.asarray(smooth)
