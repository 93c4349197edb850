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

"""One test on nominal recordings, each of them judged by limits learned without it.

Of every recording the mean and the mean square of the statistic are kept, and with them centre
and scatter of any subset of recordings are sums. So leaving one recording out (or one unit, where
there are several) costs no second calibration.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]
Flags = npt.NDArray[np.bool_]


GUARD = 1.25
"""A limit is at least so many times the largest nominal value."""
COEFFICIENT_GUARD = 2.0
"""The same where a coefficient is tested: what units differ by is out of it, and what is left, such
as the friction along the travel, is that of the motion, of which recordings have few. As it is no
noise, what the stated rate asks for by itself counts by as much more."""
LEAST_IN_REGION = 5
"""Fewer recordings in a region do not determine its scatter: those of all regions do."""


@dataclass(frozen=True)
class WindowStatistic:
    """Statistic of a test over one recording, its region, and what units differ by in it.

    All of shape (n,); ``variance`` is what the test adds to that of nominal recordings.
    """

    values: Array
    region: npt.NDArray[np.int64]
    variance: Array


@dataclass(frozen=True)
class WindowFit:
    """A test: centre and scatter by region, and the largest |z| of each recording without itself.

    ``maxima`` and ``tested`` have shape (recordings,), NaN where the test cannot be made: by the
    scatter of nominal recordings alone, and with what units differ by, as in a diagnosis.
    ``least_k`` is the limit that the stated rate asks for by itself.
    """

    name: str
    window: int
    centre: tuple[float, ...]
    sigma: tuple[float, ...]
    least_k: float
    maxima: Array
    tested: Array
    widening: float = 1.0
    """Factor of the limit, from the tail of the scores."""
    along: str = ""
    """Reading whose coefficient is tested; empty: it is a mean."""
    noise: float = 0.0
    """Noise of a sample of the residual, where a coefficient is tested."""

    @property
    def words(self) -> str:
        """What is tested."""
        what = f"coefficient on {self.along}" if self.along else "mean"
        return f"{self.name}, {what} of {self.window}"

    @property
    def guard(self) -> float:
        """Least limit in times the largest nominal value."""
        return COEFFICIENT_GUARD if self.along else GUARD

    @property
    def k(self) -> float:
        """Limit of |z|."""
        return self.widening * float(self._limit(np.asarray(np.nanmax(self.maxima))))

    def _limit(self, largest: Array) -> Array:
        """Limit where so much is the largest nominal value."""
        return np.maximum(self.least_k * self.guard / GUARD, self.guard * largest)

    @property
    def shift_limit(self) -> tuple[float, float]:
        """Sigma and limit of a test of a shift: a coefficient comes in sigmas of the noise."""
        if self.along:
            return self.noise, self.k * self.sigma[0]
        return self.sigma[0], self.k

    def scores(self, others: Flags) -> Array:
        """Largest |z| of each recording over the limit learned from ``others``, shape (n,).

        A recording at 1 would just have raised a false alarm.
        """
        seen = np.where(others, np.nan_to_num(self.maxima), 0.0).max(axis=1)
        return np.asarray(self.tested / self._limit(seen))


def others_of(folds: Sequence[str]) -> Flags:
    """Which recordings judge which, shape (n, n): all of another fold."""
    names = np.array(tuple(folds))
    return np.asarray(names[:, None] != names[None, :])


def window_fit(
    name: str,
    window: int,
    statistics: Sequence[WindowStatistic],
    regions: int,
    least_k: float,
    others: Flags,
    centred: bool = True,
    judged: Sequence[WindowStatistic] = (),
) -> WindowFit | None:
    """Fit of one test; None where fewer than two recordings, or no scatter, show it.

    Parameters
    ----------
    statistics
        Of every recording, empty where it has none.
    centred
        Whether the centre is estimated; otherwise it is 0.
    judged
        The same by parameters fitted without the recording, where they differ.
    """
    mean, square = (_by_region(statistics, regions, power) for power in (1, 2))
    if np.isfinite(mean[:, -1]).sum() < 2:
        return None
    everyone = np.ones((1, len(statistics)), dtype=bool)
    centre, sigma = _moments(mean, square, everyone, centred)
    if not sigma.max() > 1e-9:
        return None
    judged_by = _moments(mean, square, others, centred)
    maxima, tested = np.full((2, len(statistics)), np.nan)
    for each, row in enumerate(judged or statistics):
        if len(row.values) and np.isfinite(judged_by[1][each]).all():
            own_centre, own_sigma = (moment[each].take(row.region) for moment in judged_by)
            apart = np.abs(row.values - own_centre)
            maxima[each] = float((apart / own_sigma).max())
            tested[each] = float((apart / np.sqrt(own_sigma**2 + row.variance)).max())
    if not np.isfinite(maxima).any():
        return None
    middle, scatter = tuple(centre[0].tolist()), tuple(sigma[0].tolist())
    return WindowFit(name, window, middle, scatter, least_k, maxima, tested)


def _by_region(statistics: Sequence[WindowStatistic], regions: int, power: int) -> Array:
    """Mean power of each recording by region, and of all regions in the last column."""
    found = np.full((len(statistics), regions + 1), np.nan)
    for each, row in enumerate(statistics):
        if not len(row.values):
            continue
        powers = row.values**power
        found[each, -1] = powers.mean()
        count = np.bincount(row.region, minlength=regions)
        sums = np.bincount(row.region, powers, minlength=regions)
        found[each, :-1][count > 0] = (sums / np.maximum(count, 1))[count > 0]
    return found


def _moments(mean: Array, square: Array, use: Flags, centred: bool) -> tuple[Array, Array]:
    """Centre and scatter by region, shape (subsets, regions), every recording with equal weight.

    ``use``, shape (subsets, recordings), says which recordings make each subset.
    """
    count = use.astype(float) @ np.isfinite(mean)
    with np.errstate(invalid="ignore", divide="ignore"):
        centre = use @ np.nan_to_num(mean) / count * centred
        variance = use @ np.nan_to_num(square) / count - centre**2
    sigma = np.sqrt(np.maximum(variance, 1e-18))
    few = count[:, :-1] < LEAST_IN_REGION
    pooled = sigma[:, -1:]
    return (
        np.where(few, centre[:, -1:], centre[:, :-1]),
        np.maximum(np.where(few, pooled, sigma[:, :-1]), 0.5 * pooled),
    )
