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

"""Step of a position: a mass cannot step, so the sensor did.

Three estimates of the step between two scans are held against each other, and the smallest
counts, if all agree in sign: the difference of straight lines through ``SPAN`` scans before
and after, that of medians of three, which one outlier does not move, and what the reading
went in this one interval beyond its neighbours, which a mass that bounces off an end stop goes
in several. Taking a line on both sides leaves a constant acceleration out. A mass that stops
dead changes its speed within a scan: what that can look like is taken off.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]

SPAN = 6
"""Scans on either side of a step; it is known this many scans later."""
_OUT = np.arange(SPAN) + 0.5
_LINE = np.linalg.pinv(np.stack((np.ones(SPAN), _OUT), axis=1))
LEVEL, SLOPE = tuple(_LINE[0].tolist()), tuple(_LINE[1].tolist())
"""Weights of a line's value at its nearer end, and of its slope, from the inside outwards."""


def position_steps(values: Array) -> Array:
    """Step in the middle of each 2 SPAN scans, shape (n,) gives (n - 2 SPAN + 1,).

    NaN where a reading is missing, 0 where no step is seen.
    """
    count = len(values) - 2 * SPAN + 1
    if count == 1:
        return np.array([step_of(values.tolist(), min, max)])
    columns = [values[k : k + count] for k in range(2 * SPAN)]
    with np.errstate(invalid="ignore"):
        return np.asarray(step_of(columns, np.minimum, np.maximum))


def step_of(x: Any, least: Any, most: Any) -> Any:
    """Step of 2 SPAN readings; numbers and columns give the same bits.

    ``least`` and ``most`` are the minimum and maximum of two such; numba compiles this as well.
    """
    step, bend = 0.0, 0.0
    for k in range(SPAN):
        before, after = x[SPAN - 1 - k], x[SPAN + k]
        step = step + LEVEL[k] * (after - before)
        bend = bend + SLOPE[k] * (after + before)
    early, near = middle_of(x, 0, least, most), middle_of(x, 3, least, most)
    late, far = middle_of(x, 6, least, most), middle_of(x, 9, least, most)
    middle = (1.5 * late - 0.5 * far) - (1.5 * near - 0.5 * early)
    # x6 - x5 less the mean of x5 - x4 and x7 - x6.
    here = 1.5 * (x[SPAN] - x[SPAN - 1]) - 0.5 * (x[SPAN + 1] - x[SPAN - 2])
    low, high = least(least(step, middle), here), most(most(step, middle), here)
    # A missing reading makes the lines NaN, and through them the sum.
    return most(low - abs(bend), 0.0) + least(high + abs(bend), 0.0) + 0.0 * step


def middle_of(x: Any, k: int, least: Any, most: Any) -> Any:
    """Median of three from ``k`` on."""
    return most(least(x[k], x[k + 1]), least(most(x[k], x[k + 1]), x[k + 2]))


class TurnedPosition(NamedTuple):
    """A position that the motor turns directly: what it has turned meanwhile is no step.

    An opening of two scans lets a load move it by more than any healthy motion.

    Attributes
    ----------
    place
        Of its test.
    column, speed
        Of its readings and of those of the speed.
    way
        By how much it moves in a scan for one unit of the speed.
    size
        The least step that is one.
    """

    place: int
    column: int
    speed: int
    way: float
    size: float

    def stand_beside_speed(self, recent: Array, z: Array) -> None:
        """Take it off the steps that are beyond their limit; ``z`` has shape (n, tests).

        ``recent`` are the readings of these scans and of those before, the last ones last.
        """
        for n in np.flatnonzero(np.abs(z[:, self.place]) > 1.0).tolist():
            read = recent[n : n + 2 * SPAN]
            apart = read[:, self.column] - self.way * np.cumsum(read[:, self.speed])
            left = step_of(apart.tolist(), min, max) / self.size
            up = math.copysign(1.0, z[n, self.place])
            if up * left < up * z[n, self.place]:
                z[n, self.place] = up * max(up * left, 0.0)
