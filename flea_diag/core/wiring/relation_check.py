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

"""Whether the relations of a stand hold on some seconds of readings, for any healthy unit.

The parameters in which healthy units differ are fitted to the readings, with the spread of
healthy units as their prior. What is left of every relation is averaged over stretches of as many
samples as the windows of its test have, and held against the limits of that test.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from flea_diag.core.calibration.calibration import Calibration
from flea_diag.core.detection.window_limit import SPEED_REGIONS_M_S, WindowLimit
from flea_diag.core.frozen import Frozen
from flea_diag.core.residuals.parameters import UNIT_PARAMETERS
from flea_diag.core.residuals.relation_set import RelationSet
from flea_diag.core.residuals.residual_bank import ResidualBank
from flea_diag.core.residuals.residual_rows import ResidualRows
from flea_diag.core.residuals.unit_difference import LEAST

Array = npt.NDArray[np.float64]

MOST_TOLERANCES = 4.0
"""By how many standard deviations of healthy units one of them differs at most."""
TYPICAL_SHARE, TYPICAL_SQUARE = 0.8, 1.6
"""Largest share of a limit, and mean square of a statistic, that healthy machines show in some
seconds. Measured: 0.73 and 1.5 in 108 runs of three simulated machines."""


@dataclass(frozen=True)
class Holding:
    """How relations hold.

    ``share``, shape (residuals,): the largest share of a limit, NaN where nothing was judged;
    ``judged``: samples of each. ``squares``: sum of the squared statistics of all, of which there
    are ``count``, and of the deviations of the unit; ``unit``: the largest share of what a healthy
    unit differs by.
    """

    share: Array
    judged: Array
    squares: float
    count: int
    unit: float

    @property
    def worst(self) -> float:
        """The largest share of a limit; 0 where nothing was judged."""
        return max(float(np.nanmax(self.share, initial=0.0)), self.unit)

    @property
    def place(self) -> int:
        """Column of the residual with the largest share; of some where nothing was judged."""
        return int(np.argmax(np.nan_to_num(self.share, nan=-1.0)))

    @property
    def holds(self) -> bool:
        """Whether all relations are within their limits."""
        return self.worst <= 1.0

    @property
    def is_typical(self) -> bool:
        """Whether they hold as they do on a healthy machine."""
        return self.worst <= TYPICAL_SHARE and self.squares <= TYPICAL_SQUARE * self.count


class RelationCheck(Frozen):
    """Holds the relations of one stand against readings."""

    def __init__(self, relations: RelationSet, calibration: Calibration) -> None:
        self._relations, self._c = relations, calibration
        self._known = relations.residuals
        limits = {limit.name: limit for limit in calibration.limits}
        names = (row.name for row in self._known.parities)
        self._limits = {self._known.place[n]: limits[n] for n in names if n in limits}
        self._tolerance = np.maximum(calibration.tolerances(), LEAST)
        self._prior = np.diag(1.0 / np.square(self._tolerance))

    def hold(self, rows: Array, fitted: bool = True) -> Holding:
        """How the relations hold on rows of readings, shape (n, channels), from a fresh start.

        ``fitted`` to the unit, or of one as calibrated.
        """
        c = self._c
        bank = ResidualBank(c.parameters, self._relations, period_s=c.period_s, counts=c.counts)
        formed = bank.step(rows, False)
        change = self._unit(formed) if fitted else np.zeros(len(UNIT_PARAMETERS))
        share = np.full(len(self._known.rows), np.nan)
        judged = np.zeros(len(share))
        apart = np.abs(change) / self._tolerance
        squares, count = float(np.square(apart).sum()), 0
        for place, limit in self._limits.items():
            values, _, speeds = self._samples(formed, place, change)
            judged[place] = len(values)
            for number, window in enumerate(limit.windows):
                z, k = _statistics(values, speeds, window)
                if not len(z):
                    continue
                share[place] = np.fmax(share[place], np.max(np.abs(z) / k))
                if not number:
                    squares, count = squares + float(np.square(z).sum()), count + len(z)
        return Holding(share, judged, squares, count, float(np.max(apart)) / MOST_TOLERANCES)

    def _unit(self, formed: ResidualRows) -> Array:
        """By how much the parameters of this unit differ, shape (unit parameters,)."""
        information, vector = self._prior.copy(), np.zeros(len(UNIT_PARAMETERS))
        for place, limit in self._limits.items():
            if place not in self._known.spreading or self._known.parities[place].normalised:
                continue
            values, spread, _ = self._samples(formed, place, np.zeros(len(UNIT_PARAMETERS)))
            variance = limit.sigma[0] ** 2 * limit.correlation_samples
            information += spread.T @ spread / variance
            vector -= spread.T @ values / variance
        return np.asarray(np.linalg.solve(information, vector), dtype=np.float64)

    def _samples(
        self, formed: ResidualRows, place: int, change: Array
    ) -> tuple[Array, Array, Array]:
        """Valid samples of one residual, of a unit changed so; its sensitivities, and speeds."""
        noise = 1.0 if formed.noise is None else formed.noise[:, place]
        values = formed.values[:, place] / noise
        use = np.isfinite(values)
        if self._known.rows[place].gate == "moving":
            use &= formed.moving
        spread: Array = np.zeros((int(use.sum()), len(UNIT_PARAMETERS)))
        if place in self._known.spreading:
            spread = formed.spread[use, self._known.spreading.index(place)]
        spread = np.asarray(np.nan_to_num(spread))
        return values[use] + spread @ change, spread, np.nan_to_num(np.abs(formed.speed_m_s[use]))


def _statistics(values: Array, speeds: Array, window: WindowLimit) -> tuple[Array, Array]:
    """Statistic of the mean of each stretch of ``window.window`` samples, and the limit of |z|."""
    count = len(values) // window.window
    if not count:
        return np.empty(0), np.empty(0)
    shape, used = (count, window.window), count * window.window
    means = values[:used].reshape(shape).mean(axis=1)
    region = np.searchsorted(SPEED_REGIONS_M_S, speeds[:used].reshape(shape).mean(axis=1))
    z = (means - np.array(window.centre)[region]) / np.array(window.sigma)[region]
    return z, np.full(count, window.k)
