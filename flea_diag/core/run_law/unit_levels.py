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

"""Recordings of units of one design: a mean of each unit, about a mean of the design.

    b_jk = m + u_j + c_jk ,   u_j ~ N(0, S_unit),   c_jk ~ N(0, S_run)

Of one unit alone the mean of the design is not known: its own takes its place. The unit of a
recording that is judged is known by its other recordings; where it has none, it is any unit.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import numpy.typing as npt

from flea_diag.core.run_law.known_variance import KnownVariance
from flea_diag.core.run_law.restricted_likelihood import Spread, run_estimates, run_variance
from flea_diag.core.run_law.run_sums import RunSums
from flea_diag.core.run_law.variance_prior import VariancePrior

Array = npt.NDArray[np.float64]
Places = npt.NDArray[np.intp]

LEAST_UNITS = 5
"""Units from which on what units differ by is learned; with fewer it is the tolerance."""


@dataclass(frozen=True, eq=False)
class UnitLevels:
    """Variances between recordings and between units, and what the recordings say of means.

    Attributes
    ----------
    sums
        Of the recordings that it was learned from.
    prior
        Of S_run.
    variance, unit_variance
        S_run and S_unit, shape (columns,).
    mean_prior
        Variances of the mean, shape (columns,).
    groups
        Unit of each recording, shape (recordings,).
    """

    sums: RunSums
    prior: VariancePrior
    variance: Array
    unit_variance: Array
    mean_prior: Array
    groups: Places

    @classmethod
    def of(
        cls, sums: RunSums, prior: VariancePrior, unit_scale: Array, mean_prior: Array,
        groups: Places,
    ) -> UnitLevels:  # fmt: skip
        """Learn both variances; ``unit_scale`` is that of the prior of S_unit."""
        variance = run_variance(sums, prior, mean_prior, groups)
        made = cls(sums, prior, variance, unit_scale, mean_prior, groups)
        if len(made.units) < LEAST_UNITS:
            return made
        every = RunSums.stacked(made.unit_sums[unit] for unit in made.units)
        one = np.zeros(len(every), dtype=np.intp)
        least = np.maximum(unit_scale, 1e-8)
        between = run_variance(every, replace(prior, scale=least), mean_prior, one)
        return replace(made, unit_variance=np.where(unit_scale > 0.0, between, 0.0))

    @cached_property
    def units(self) -> list[int]:
        """Units that have recordings."""
        return [int(unit) for unit in np.unique(self.groups)]

    @cached_property
    def freed(self) -> RunSums:
        """What each recording says of the mean of its unit."""
        return self.sums.freed(self.variance)

    @cached_property
    def unit_sums(self) -> dict[int, RunSums]:
        """The same of all recordings of each unit."""
        return {unit: self.freed[np.flatnonzero(self.groups == unit)].total for unit in self.units}

    @cached_property
    def _of_design(self) -> dict[int, RunSums]:
        """What each unit says of the mean of the design."""
        return {unit: sums.freed(self.unit_variance) for unit, sums in self.unit_sums.items()}

    def design(self, without: int = -1) -> tuple[Array, Array]:
        """Mean of the design and its covariance, by all units but one."""
        information = np.diag(1.0 / self.mean_prior)
        vector = np.zeros(len(self.mean_prior))
        for unit, sums in self._of_design.items():
            if unit != without:
                information = information + sums.gram
                vector = vector + sums.cross
        covariance = np.asarray(np.linalg.inv(information), dtype=np.float64)
        return covariance @ vector, covariance

    def of_unit(self, unit: int, without: int = -1, wide: bool = False) -> Spread:
        """Spread of further recordings of a unit, by all recordings but one of them.

        ``wide``: as wide as a claim is held against.
        """
        mean, covariance = self._before(unit)
        information = np.linalg.inv(covariance)
        vector = information @ mean
        if unit in self.unit_sums:
            information = information + self.unit_sums[unit].gram
            vector = vector + self.unit_sums[unit].cross
        if without >= 0:
            information = information - self.freed[without].gram
            vector = vector - self.freed[without].cross
        covariance = np.linalg.inv(information)
        return Spread(covariance @ vector, self._variance(without, wide), covariance)

    def _variance(self, without: int, wide: bool) -> Array:
        likely = self.variance if without < 0 else self.known.likely(without)
        return np.asarray(np.maximum(likely, self.known.wide(without))) if wide else likely

    def _before(self, unit: int) -> tuple[Array, Array]:
        """What is known of a unit before its own recordings."""
        if not [other for other in self.units if other != unit]:
            return np.zeros(len(self.mean_prior)), np.diag(self.mean_prior)
        mean, covariance = self.design(unit)
        return mean, covariance + np.diag(self.unit_variance)

    @cached_property
    def known(self) -> KnownVariance:
        """How well S_run is known."""
        apart, error = run_estimates(self.sums, self.variance, self.mean_prior, self.groups)
        return KnownVariance.of(apart, error, self.variance, self.prior)
