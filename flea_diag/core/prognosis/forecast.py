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

"""When a size will reach a limit: all growth laws with all their parameters, weighed by the sizes.

A law is known from its size ``a`` at the first recording and its growth ``d`` until the last one,
both at least such that no size is below 0; all values are as likely beforehand. The own errors are
off by a factor ``s`` of the distribution ``STATED_FREEDOM / chi^2``. With ``C`` of ``size_series``

    log p(y | law, a, d, s) = -(ln |C| + (y - g)' C^-1 (y - g)) / 2 ,

summed over a grid of ``a``, ``d`` and ``s`` and over the laws. Where a law with these values
reaches the limit follows in closed form, so the forecast is a weighted sum over the grid: no random
draws, and no assumption that errors of the parameters are normal. The model of a fault gives its
size but for a factor, the same in all recordings of a unit; a limit is as uncertain by it.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt

from flea_diag.core.prognosis.growth_law import LAWS, GrowthLaw
from flea_diag.core.prognosis.size_series import STATED_FREEDOM, SizeSeries

Array = npt.NDArray[np.float64]

LEAST_RECORDINGS = 3
"""With fewer nothing tells one law from another, nor growth from scatter."""
CELLS, ROUNDS = 48, 3
"""Cells of the grid along ``a`` and along ``d``, and how often it is laid closer about the peak."""
SCALES = np.geomspace(0.3, 12.0, 12)
WITHIN_NATS = 12.0
"""Cells less likely by more than this count for nothing."""
SHARES = (0.05, 0.5, 0.95)
"""Quantiles that are told of when a limit is reached."""
GAIN = 0.04
"""Sigma of that factor: among 16 developed units of four kinds of wear, worn to their ends."""
GAINS = 1.0 + GAIN * np.array([-1.645, -1.036, -0.674, -0.385, -0.126, 0.126, 0.385, 0.674, 1.036,
                               1.645])  # fmt: skip
"""The middles of ten equally likely parts of it."""
REACH = 8.0
"""Standard errors about the sizes that the first grid covers."""


@dataclass(frozen=True)
class LimitCrossing:
    """When a limit is reached: the quantiles ``SHARES`` in s on the clock of the series.

    Infinite: never. ``crossed`` is the probability that it was at the last recording, ``never``
    that it never is.
    """

    limit: float
    low_s: float
    median_s: float
    high_s: float
    crossed: float
    never: float


@dataclass(frozen=True, eq=False)
class Forecast:
    """Values of the laws with their weights, all of shape (values,); weights sum to 1.

    ``start_s`` and ``span_s`` are when the first recording was and how long until the last.
    """

    start_s: float
    span_s: float
    laws: tuple[GrowthLaw, ...]
    law: npt.NDArray[np.intp]
    first: Array
    last: Array
    weights: Array

    def crossing_s(self, limit: float) -> Array:
        """When each reaches the limit, on the clock of the series; infinite: never."""
        found = np.full(len(self.weights), np.inf)
        for number, law in enumerate(self.laws):
            rows = np.flatnonzero((self.law == number) & (self.last > self.first))
            low, high = law.straight(self.first[rows]), law.straight(self.last[rows])
            found[rows] = (law.straight(limit) - low) / (high - low)
        return np.asarray(self.start_s + self.span_s * found)

    def crossing(self, limit: float) -> LimitCrossing:
        """When a limit is reached, with probabilities."""
        times = np.concatenate([self.crossing_s(limit * gain) for gain in GAINS.tolist()])
        weights = np.tile(self.weights / len(GAINS), len(GAINS))
        crossed = float(weights[times <= self.start_s + self.span_s].sum())
        never = float(weights[np.isinf(times)].sum())
        low_s, median_s, high_s = _quantiles(times, weights, SHARES)
        return LimitCrossing(limit, low_s, median_s, high_s, crossed, never)

    def sizes_at(self, time_s: float) -> Array:
        """Size of each at a time."""
        found = np.zeros(len(self.weights))
        share = (time_s - self.start_s) / self.span_s
        for number, law in enumerate(self.laws):
            rows = self.law == number
            low, high = law.straight(self.first[rows]), law.straight(self.last[rows])
            found[rows] = law.size(low + share * (high - low))
        return found

    def quantiles(self, values: Array, shares: Sequence[float]) -> tuple[float, ...]:
        """Quantiles of any values of the grid; infinite ones are beyond all others."""
        return _quantiles(values, self.weights, shares)

    def share(self, which: npt.NDArray[np.bool_]) -> float:
        """Probability of some of the values."""
        return float(self.weights[which].sum())

    @cached_property
    def of_laws(self) -> dict[str, float]:
        """Probability of each law."""
        return {law.name: self.share(self.law == k) for k, law in enumerate(self.laws)}


def _quantiles(values: Array, weights: Array, shares: Sequence[float]) -> tuple[float, ...]:
    order = np.argsort(values)
    places = np.minimum(np.searchsorted(np.cumsum(weights[order]), shares), len(order) - 1)
    return tuple(values[order[places]].tolist())


def forecast(series: SizeSeries, laws: Sequence[GrowthLaw] = LAWS) -> Forecast | None:
    """Weigh the laws; None of fewer than ``LEAST_RECORDINGS``, or where all are at one time."""
    start_s, span_s = float(series.times[0]), float(series.times[-1] - series.times[0])
    if len(series) < LEAST_RECORDINGS or span_s <= 0.0:
        return None
    shares = (series.times - start_s) / span_s
    errors = _SeriesErrors.of(series)
    grids = [_refined(law, series, shares, errors) for law in laws]
    law = np.repeat(np.arange(len(laws)), [len(logs) for _, _, logs in grids])
    first, last, logs = (np.concatenate(column) for column in zip(*grids, strict=True))
    weights = np.exp(logs - logs.max())
    known = weights > math.exp(-WITHIN_NATS)
    return Forecast(
        start_s, span_s, tuple(laws), law[known], first[known], last[known],
        weights[known] / weights[known].sum(),
    )  # fmt: skip


@dataclass(frozen=True, eq=False)
class _SeriesErrors:
    """``C`` at any ``s``, by the eigenvalues of ``L' D^-1 L``.

    With ``r`` over the own errors and ``u`` along the eigenvectors, ``r' C^-1 r`` is
    ``(|r|^2 - sum u^2 / (s^2 + eigenvalue)) / s^2`` (Woodbury).

    Attributes
    ----------
    own
        Shape (n,).
    along
        Own errors of what is left to ``u``, shape (differences, n).
    eigenvalues
        Shape (differences,), those above 0 alone.
    """

    own: Array
    along: Array
    eigenvalues: Array

    @staticmethod
    def of(series: SizeSeries) -> _SeriesErrors:
        """Of the sizes of a series."""
        moved = series.from_unit / series.own[:, None]
        values, vectors = np.linalg.eigh(moved.T @ moved)
        shown = values > 1e-12 * max(float(values.max(initial=0.0)), 1.0)
        return _SeriesErrors(series.own, (moved @ vectors[:, shown]).T, values[shown])

    def logs(self, left: Array) -> Array:
        """Log weights of columns of what is left, shape (n, columns), over all ``SCALES``."""
        scaled = left / self.own[:, None]
        square, along = np.square(scaled).sum(axis=0), np.square(self.along @ scaled)
        each = []
        for scale in SCALES.tolist():
            variances = scale**2 + self.eigenvalues
            misfit = (square - (along / variances[:, None]).sum(axis=0)) / scale**2
            known = STATED_FREEDOM * (math.log(scale) + 0.5 / scale**2)
            free = len(left) - len(variances)
            volume = free * math.log(scale) + 0.5 * float(np.log(variances).sum())
            each.append(-known - volume - 0.5 * misfit)
        return np.asarray(np.logaddexp.reduce(each, axis=0))


def _refined(
    law: GrowthLaw, series: SizeSeries, shares: Array, errors: _SeriesErrors
) -> tuple[Array, Array, Array]:
    """Sizes at the first and the last recording and their log weights, on the closest grid."""
    low, high = _box(series)
    for _ in range(ROUNDS):
        width = (high - low) / CELLS
        middles = low[:, None] + width[:, None] * (np.arange(CELLS) + 0.5)
        first, grown = (axis.ravel() for axis in np.meshgrid(*middles, indexing="ij"))
        possible = first + grown > 0.0
        first, last = first[possible], (first + grown)[possible]
        left = series.sizes[:, None] - _course(law, first, last, shares)
        logs = errors.logs(left) + float(np.log(width).sum())
        likely = logs > logs.max() - WITHIN_NATS
        corners = np.stack((first[likely], (last - first)[likely]))
        low = np.maximum(corners.min(axis=1) - 0.5 * width, [0.0, -np.inf])
        high = corners.max(axis=1) + 0.5 * width
    return first, last, logs


def _box(series: SizeSeries) -> tuple[Array, Array]:
    """Lowest and highest first size and growth that the sizes allow."""
    total = float(np.sqrt(np.diagonal(series.covariance()).max()))
    own = float(np.sqrt(2.0) * series.own.max())
    grown = float(series.sizes[-1] - series.sizes[0])
    top = max(float(series.sizes.min()), 0.0) + REACH * total
    return np.array([0.0, grown - 2.0 * REACH * own]), np.array([top, grown + 2.0 * REACH * own])


def _course(law: GrowthLaw, first: Array, last: Array, shares: Array) -> Array:
    """Sizes at shares of the span, shape (shares, values)."""
    low, high = law.straight(first), law.straight(last)
    return law.size(low + np.outer(shares, high - low))
