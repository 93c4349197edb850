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

What is left of each relation is averaged over stretches as long as the windows of its test, and
held against the limits of that test. In what healthy units differ by, and in the sizes of a fault,
the averages are linear: both are fitted to them, the first with the spread of healthy units as
their prior.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from flea_diag.core.calibration.calibration import Calibration
from flea_diag.core.detection.window_limit import SPEED_REGIONS_M_S, WindowLimit
from flea_diag.core.frozen import Frozen
from flea_diag.core.likelihood.basis import Basis, effect_of
from flea_diag.core.likelihood.bounded_systems import BoundedSystems
from flea_diag.core.likelihood.effect_set import EffectSet
from flea_diag.core.likelihood.effects import ELAPSED
from flea_diag.core.likelihood.fault_models import FaultModel
from flea_diag.core.residual_values import ResidualRows
from flea_diag.core.residuals.parameters import UNIT_PARAMETERS
from flea_diag.core.residuals.residual_bank import ResidualBank
from flea_diag.core.residuals.unit_difference import LEAST

Array = npt.NDArray[np.float64]
Columns = Callable[[Array, ResidualRows], Array]
"""Basis signals of the faults, of readings of shape (n, channels) and their residuals."""

TYPICAL_SHARE, TYPICAL_SQUARE = 0.8, 1.6
"""Largest share of a limit, and mean square of a statistic, that healthy machines show in some
seconds. Measured: 0.73 and 1.5 in 108 runs of three simulated machines."""


@dataclass(frozen=True)
class Stretches:
    """Averages of one residual over stretches of ``limit.window`` samples, in their sigmas.

    ``z`` has shape (m,), ``unit`` (m, unit parameters), ``columns`` (m, basis signals).
    """

    residual: int
    limit: WindowLimit
    z: Array
    unit: Array
    columns: Array


@dataclass(frozen=True)
class Holding:
    """How relations hold.

    ``share``, shape (residuals,): the largest share of a limit, NaN where nothing was judged;
    ``judged``: samples of each. ``squares``: sum of the squared statistics of all, of which there
    are ``count``, and of the deviations of the unit, each in its own sigma. ``raw_place`` is the
    residual that a unit as calibrated would have off most.
    """

    share: Array
    judged: Array
    squares: float
    count: int
    raw_place: int

    @property
    def worst(self) -> float:
        """The largest share of a limit; 0 where nothing was judged."""
        return float(np.nanmax(self.share, initial=0.0))

    @property
    def place(self) -> int:
        """Column of the residual with the largest share; of some where nothing was judged."""
        return _largest(self.share)

    @property
    def is_typical(self) -> bool:
        """Whether they hold as they do on a healthy machine."""
        return self.worst <= TYPICAL_SHARE and self.squares <= TYPICAL_SQUARE * self.count


class RelationCheck(Frozen):
    """Holds the relations of one stand against readings."""

    def __init__(self, effects: EffectSet, calibration: Calibration, columns: Columns) -> None:
        self._relations, self._c, self._columns = effects.relations, calibration, columns
        self._known = effects.residuals
        limits = {limit.name: limit for limit in calibration.limits}
        names = (row.name for row in self._known.parities)
        self._limits = {self._known.place[n]: limits[n] for n in names if n in limits}
        self._names = {place: limit.name for place, limit in self._limits.items()}
        self._prior = 1.0 / np.square(np.maximum(calibration.tolerances(), LEAST))
        self._models = effects.bound(calibration.parameters)
        self._basis: Basis = effects.basis_of(calibration.parameters)

    def hold(self, rows: Array) -> Holding:
        """How the relations hold on rows of readings, shape (n, channels), from a fresh start."""
        every, judged = self._stretches(rows, with_columns=False)
        change, squares = self._fit(every, None)
        share, raw = (np.full(len(self._known.rows), np.nan) for _ in range(2))
        for each in every:
            place, k = each.residual, each.limit.k
            share[place] = np.fmax(share[place], np.max(np.abs(each.z + each.unit @ change)) / k)
            raw[place] = np.fmax(raw[place], np.max(np.abs(each.z)) / k)
        count = sum(len(each.z) for each in self._first(every))
        return Holding(share, judged, squares, count, _largest(raw))

    def left_by_faults(self, rows: Array) -> dict[str, float]:
        """``Holding.squares`` with each fault of the catalogue, of whatever size it may have."""
        every, _ = self._stretches(rows, with_columns=True)
        found: dict[str, float] = {}
        for model in self._models:
            _, squares = self._fit(every, model)
            found[model.fault] = min(squares, found.get(model.fault, np.inf))
        return found

    def _first(self, every: list[Stretches]) -> Iterator[Stretches]:
        """Those of the shortest window: longer ones, or by direction, average the same again."""
        once = (e for e in every if not self._known.parities[e.residual].normalised)
        return (e for e in once if e.limit is self._limits[e.residual].windows[0])

    def _fit(self, every: list[Stretches], model: FaultModel | None) -> tuple[Array, float]:
        """What the unit differs by, with a fault of one size or more; and the squares left."""
        sizes = 0 if model is None else len(model.sizes)
        A = np.diag(np.append(np.zeros(sizes), self._prior))
        b, square = np.zeros(len(A)), 0.0
        for each in self._first(every):
            design = np.empty((len(each.z), len(A)))
            design[:, sizes:] = -each.unit
            if model is not None:
                name = self._names[each.residual]
                ones = np.eye(sizes).tolist()
                effects = [effect_of(model, name, unit, self._basis) for unit in ones]
                design[:, :sizes] = each.columns @ np.array(effects).T
            A, b = A + design.T @ design, b + design.T @ each.z
            square += float(each.z @ each.z)
        fit = BoundedSystems((model,), (0,), A[None], b[None], sizes)
        return fit.solutions[0, sizes:], fit.misfit(0, square)

    def _stretches(self, rows: Array, with_columns: bool) -> tuple[list[Stretches], Array]:
        """Averages of every residual that has a limit, over each of its windows; its samples."""
        c = self._c
        bank = ResidualBank(c.parameters, self._relations, period_s=c.period_s, counts=c.counts)
        formed = bank.step(rows, False)
        basis = self._columns(rows, formed) if with_columns else np.empty((len(rows), 0))
        if with_columns:
            basis = basis[:, : len(self._basis.names)]
            if str(ELAPSED) in self._basis.column:
                basis[:, self._basis.column[str(ELAPSED)]] = c.period_s * np.arange(len(rows))
        found, judged = [], np.zeros(len(self._known.rows))
        for place, limit in self._limits.items():
            samples, speeds = self._samples(formed, place, basis)
            judged[place] = len(samples)
            for window in limit.windows:
                if len(samples) >= window.window:
                    found.append(_averaged(place, window, samples, speeds))
        return found, judged

    def _samples(self, formed: ResidualRows, place: int, basis: Array) -> tuple[Array, Array]:
        """Valid samples of one residual beside what moves it, and the speeds of these scans."""
        values = formed.values[:, place]
        use = np.isfinite(values)
        if self._known.rows[place].gate == "moving":
            use &= formed.moving
        rows, units = np.flatnonzero(use), 1 + len(UNIT_PARAMETERS)
        samples = np.zeros((len(rows), units + basis.shape[1]))
        samples[:, 0] = values[rows]
        if place in self._known.spreading:
            samples[:, 1:units] = formed.spread[rows, self._known.spreading.index(place)]
        samples[:, units:] = basis[rows]
        np.nan_to_num(samples, copy=False)
        if formed.noise is not None:
            # What was bridged is noisier: it counts for less.
            samples /= formed.noise[rows, place, None]
        return samples, np.nan_to_num(np.abs(formed.speed_m_s[rows]))


def _averaged(place: int, window: WindowLimit, samples: Array, speeds: Array) -> Stretches:
    count = len(samples) // window.window
    used = count * window.window
    means = samples[:used].reshape(count, window.window, -1).mean(axis=1)
    speed = speeds[:used].reshape(count, window.window).mean(axis=1)
    region = np.searchsorted(SPEED_REGIONS_M_S, speed)
    means[:, 0] -= np.array(window.centre)[region]
    means /= np.array(window.sigma)[region, None]
    units = 1 + len(UNIT_PARAMETERS)
    return Stretches(place, window, means[:, 0], means[:, 1:units], means[:, units:])


def _largest(share: Array) -> int:
    return int(np.argmax(np.nan_to_num(share, nan=-1.0)))
