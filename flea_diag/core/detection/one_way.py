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

"""For how long the actuator has moved one way: means over that time can be held against each other.

What a fault does to the balance that holds the friction may differ between the directions of
motion. At a standstill against a push the friction may be anything up to the dry friction.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from flea_diag.core.backend import FEW
from flea_diag.core.residual_values import ResidualRows

Array = npt.NDArray[np.float64]
Counts = npt.NDArray[np.int64]
Flags = npt.NDArray[np.bool_]


class OneWay:
    """State of one stream; ``moving_m_s`` is the least speed of a motion."""

    def __init__(self, moving_m_s: float) -> None:
        self._moving_m_s = moving_m_s
        self._way, self._lasted = 0, 0

    def step(self, rows: ResidualRows) -> tuple[Sequence[int] | Counts, Sequence[int] | Counts]:
        """Direction after each of n scans, and scans in motion since it began.

        Both are 0 where it stands against a push, and go on at rest as they were.
        """
        if len(rows) > FEW:
            return self._many(rows.moving, rows.motion[rows.moving])
        ways, lasted = [], []  # plain numbers: one scan costs less than one call of numpy
        motion = zip(rows.moving.tolist(), rows.motion.tolist(), strict=True)
        for moves, (speed, way) in motion:
            if moves:
                now = 0 if abs(speed) <= self._moving_m_s else 1 if way > 0.0 else -1
                self._lasted = self._lasted + 1 if now == self._way else 1
                self._way = now
            ways.append(self._way)
            lasted.append(self._lasted if self._way else 0)
        return ways, lasted

    def _many(self, moving: Flags, motion: Array) -> tuple[Counts, Counts]:
        """The same of n scans at once; ``motion`` of those that move."""
        speed, forth = motion[:, 0], motion[:, 1] > 0.0
        stands = np.abs(speed) <= self._moving_m_s
        way = np.append(self._way, np.where(stands, 0, np.where(forth, 1, -1)))
        begun = np.full(len(speed), -self._lasted)
        turned = np.diff(way).nonzero()[0]
        begun[turned] = turned
        lasted = np.arange(1, 1 + len(speed)) - np.maximum.accumulate(begun)
        lasted = np.append(self._lasted, lasted)
        self._way, self._lasted = int(way[-1]), int(lasted[-1])
        moved = np.cumsum(moving)  # at rest it is as after the last scan in motion
        return way[moved], np.where(way[moved] != 0, lasted[moved], 0)
