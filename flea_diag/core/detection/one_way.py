"""For how long the actuator has moved one way: means over that time can be held against each other.

What a fault does to the balance that holds the friction may differ between the directions of
motion. At a standstill against a push the friction may be anything up to the dry friction.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from flea_diag.core.residuals.residual_rows import ResidualRows

Array = npt.NDArray[np.float64]


class OneWay:
    """State of one stream; ``moving_m_s`` is the least speed of a motion."""

    def __init__(self, moving_m_s: float) -> None:
        self._moving_m_s = moving_m_s
        self._way = self._lasted = 0.0

    def step(self, rows: ResidualRows) -> Array:
        """Direction after each of n scans, and scans in motion since it began, shape (2, n).

        Both are 0 where it stands against a push, and go on at rest as they were.
        """
        moves, speed = rows.moving, rows.speed_m_s
        stands = np.abs(speed) <= self._moving_m_s
        way = np.where(stands, 0.0, np.copysign(1.0, rows.motion[:, 1]))
        ways = np.append(self._way, way[moves])
        number = np.arange(len(ways), dtype=float)
        begins = np.append(True, np.diff(ways) != 0.0)
        since = np.where(begins, number, -np.inf)
        since[0] = 1.0 - self._lasted
        lasted = np.where(ways != 0.0, number - np.maximum.accumulate(since) + 1.0, 0.0)
        self._way, self._lasted = float(ways[-1]), float(lasted[-1])
        return np.stack((ways, lasted)).take(np.cumsum(moves), axis=1)
