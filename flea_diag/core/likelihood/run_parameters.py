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

"""What is this run's own, such as a payload: estimated at each start, and again after each rest.

A description names parameters that each run may have its own value of, and their ranges. They are
estimated from the relations that hold them, jointly with friction and mass, by Bayesian least
squares in information form. Two priors count: with what healthy units differ by, the parameter is
all that can explain a level; ``REACH`` times as wide, friction explains it as well, until the
machine has gone both ways. So a level that the parameter alone explains is no evidence yet, and
one value is known once both ways agree on it.

A fault that begins while another value is learned is no value: where one has been known, none
counts that leaves more of the relations than healthy recordings do.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import Enum, auto
from functools import lru_cache
from types import FunctionType
from typing import Any

import numpy as np
import numpy.typing as npt

from flea_diag.core.frozen import Frozen
from flea_diag.core.residual_values import ResidualRows
from flea_diag.core.residuals.relation_set import RelationSet
from flea_diag.core.residuals.residual_rows import WINDOWS_S
from flea_diag.core.residuals.unit_difference import LEAST
from flea_diag.core.residuals.unit_offsets import DRAG, NUISANCE, REACH
from flea_diag.core.scan_counts import ScanCounts
from flea_diag.core.symbolic.expression import ZERO, derivative
from flea_diag.core.symbolic.generated import compiled, function_source

Array = npt.NDArray[np.float64]
Flags = npt.NDArray[np.bool_]

REST_S = 0.5
"""Standstill in which a payload may be exchanged."""
WATCH_S = max(WINDOWS_S)
"""Motion after a rest in which another value shows, where it matters to any test."""
EVERY_S = 0.1
"""Motion between two looks at the estimate."""
CHANCE = 0.01
"""Probability with which a look at the same value looks like another: that is then learned."""
TINY = 1e-12
"""Least scatter of a relation: a perfect one has none."""
FIRST, LAST = 2.0, 1.0
"""Errors, in least sigmas of a test, from which on an estimate counts, and is no more refined."""


@dataclass(frozen=True)
class FreeTerms(Frozen):
    """Where the free parameters of a description enter.

    Attributes
    ----------
    free, beside
        Free parameters, and what is estimated beside them and not kept.
    relations
        Relations that hold a free one, in the order of the results of ``slopes``.
    columns
        Of these relations among the residuals.
    slopes
        Of parameters and signals: d r / d theta of each relation by all of these parameters.
    """

    free: tuple[str, ...]
    beside: tuple[str, ...]
    relations: tuple[str, ...]
    columns: tuple[int, ...]
    slopes: FunctionType

    def of_scans(self, parameters: Any, signals: Array) -> Array:
        """D r / d theta, shape (n, relations, free and beside); signals of shape (n, signals)."""
        rows = self.slopes(parameters, list(signals.T))
        table = np.empty((len(signals), len(rows), len(self.free) + len(self.beside)))
        for j, row in enumerate(rows):
            for k, column in enumerate(row):
                table[:, j, k] = column
        return table


@lru_cache(maxsize=8)
def free_terms(known: RelationSet) -> FreeTerms | None:
    """Those of these relations; None where no relation holds a free parameter."""
    if not known.free:
        return None
    by = (*known.free, *(name for name in NUISANCE if name not in known.free))
    slopes = {
        row.name: {name: derivative(row.expression, name) for name in by} for row in known.relations
    }
    names = tuple(n for n, of in slopes.items() if any(of[free] != ZERO for free in known.free))
    if not names:
        return None
    free = tuple(f for f in known.free if any(slopes[name][f] != ZERO for name in names))
    beside = by[len(known.free) :]
    results = [[slopes[name][each] for each in (*free, *beside)] for name in names]
    source = function_source("slopes", "d r / d theta.", known.signals, results)
    columns = tuple(known.residuals.columns(names))
    return FreeTerms(free, beside, names, columns, compiled(source)["slopes"])


class RunStage(Enum):
    """What is known of the values of this run."""

    LEARNED = auto()
    """None is known, at the start or since another has shown: no relation of it is judged."""
    REFINED = auto()
    """Relations are judged, and what follows makes the values more exact."""
    KNOWN = auto()
    """They are exact enough."""


@dataclass(frozen=True, slots=True)
class RunValue(Frozen):
    """Value of a free parameter in this run and its standard deviation; ``within`` its range."""

    parameter: str
    value: float
    sigma: float
    within: bool


def own_values(terms: FreeTerms, parameters: Any, residuals: ResidualRows) -> dict[str, float]:
    """Free parameters of a whole recording, by least squares over its motion.

    ``residuals`` are those of ``parameters``; without motion they are returned as they are.
    """
    values = residuals.values[:, terms.columns]
    slopes = terms.of_scans(parameters, residuals.signals)
    use = residuals.moving & np.isfinite(values).all(axis=1) & np.isfinite(slopes).all(axis=(1, 2))
    change = np.zeros(len(terms.free))
    if use.any():
        scale = np.maximum(np.sqrt(np.square(values[use]).mean(axis=0)), TINY)
        design = (slopes[use] / scale[:, None]).reshape(-1, slopes.shape[2])
        found = np.linalg.lstsq(design, -(values[use] / scale).reshape(-1), rcond=None)[0]
        change = found[: len(change)]
    return {
        n: getattr(parameters, n) + by for n, by in zip(terms.free, change.tolist(), strict=True)
    }


@dataclass
class RunLearning:
    """Estimate of the free parameters of one run; a scan at a time.

    Parameters
    ----------
    terms
    values
        Free parameter -> the value that is in use.
    ranges
        Free parameter -> its range.
    tolerance
        What is estimated beside -> one sigma of healthy units.
    variance, least
        Of each relation the variance of a scan by which a mean of independent ones would scatter
        as it does, and the least sigma of its tests; shape (relations,).
    most
        Most that healthy recordings leave of all relations together, root mean square over the
        scans, in least sigmas.
    """

    terms: FreeTerms
    values: dict[str, float]
    ranges: Mapping[str, tuple[float, float]]
    tolerance: Mapping[str, float]
    variance: Array
    least: Array
    most: float
    counts: ScanCounts
    found: tuple[RunValue, ...] = ()
    """What is known of this run; empty while it is as calibrated."""
    covariance: Array = field(default_factory=lambda: np.empty((0, 0)))
    """Of the values in use, shape (free, free); zero while they are the calibrated ones."""

    def __post_init__(self) -> None:
        from scipy.special import chdtri

        count, width = len(self.terms.free), len(self.terms.free) + len(self.terms.beside)
        self._most, self._every = float(chdtri(count, CHANCE)), self.counts.of(EVERY_S)
        self._tight, self._wide = (self._prior(reach) for reach in (1.0, REACH))
        self.covariance, self.refined = np.zeros((count, count)), np.zeros(count)
        """The second: by how much the values in use are others than when they were first known."""
        self._still, self._watched, self.restarts = 0, 0, False
        self._watch = _Sums(width, self.least)
        # What friction and mass are like in this run: a drag is no payload at each new start.
        self._beside = np.zeros(width)
        self._learn_anew(_Sums(width, self.least))

    def _prior(self, reach: float) -> Array:
        """Information before the first scan; friction within ``reach`` times its tolerance."""
        free = [max(abs(self.values[name]), 1.0) for name in self.terms.free]
        reaches = [reach if name in DRAG else 1.0 for name in self.terms.beside]
        beside = [
            r * max(self.tolerance[name], LEAST)
            for name, r in zip(self.terms.beside, reaches, strict=True)
        ]
        return np.diag(1.0 / np.square([*free, *beside]))

    def _learn_anew(self, sums: _Sums) -> None:
        """Another value has shown in these scans, or it is the start."""
        self.stage, self._sums, self._watched, self._aim = RunStage.LEARNED, sums, 0, FIRST
        self._base, self._change = dict(self.values), np.zeros(len(self.terms.free))

    @property
    def waits(self) -> bool:
        """Whether relations that hold a free parameter are not to be judged."""
        return self.stage is RunStage.LEARNED

    @property
    def has_own(self) -> bool:
        """Whether values of this run are in use, not the calibrated ones."""
        return bool(self.covariance.any())

    def errors(self, slopes: Array) -> Array:
        """Sigma of each relation by what is not known of the values in use, shape (n, relations).

        ``slopes`` has shape (n, relations, free and beside).
        """
        of_free = slopes[:, :, : len(self.covariance)]
        found: Array = np.sqrt(np.einsum("njk,kl,njl->nj", of_free, self.covariance, of_free))
        return found

    def step(self, moves: bool, values: Array, slopes: Array, frozen: bool) -> bool:
        """Take a scan; whether the stage is another one, or other values are known.

        ``values`` of shape (relations,), ``slopes`` of (relations, free and beside). Nothing is
        learned while it is ``frozen``, within an episode.
        """
        self._still = 0 if moves else self._still + 1
        if not frozen and not self.waits and self._still == self.counts.of(REST_S):
            self._watch, self._watched = _Sums(len(slopes.T), self.least), self.counts.of(WATCH_S)
        if frozen or not moves:
            return False
        known = np.isfinite(values) & np.isfinite(slopes).all(axis=1)
        if not known.any():
            return False
        if self._watched:
            self._watched -= 1
            self._watch.add(values, slopes, known, self.variance)
            if self._watch.scans % self._every == 0 and self._shows():
                self._learn_anew(self._watch)
                return True
        if self.stage is RunStage.KNOWN:
            return False
        at_base = values - slopes[:, : len(self._change)] @ self._change
        self._sums.add(at_base, slopes, known, self.variance)
        return self._sums.scans % self._every == 0 and self._learn()

    def _shows(self) -> bool:
        """Whether the scans since a rest contradict the values in use."""
        change, covariance = self._watch.solved(self._tight, self._beside)
        change, covariance = _first(len(self._change), change, covariance)
        return bool(change @ np.linalg.solve(covariance, change) > self._most)

    def _learn(self) -> bool:
        """Whether values are known that count from now on; refined as often as errors halve."""
        every, covariance = self._sums.solved(self._wide)
        change, covariance = _first(len(self._change), every, covariance)
        error = self._sums.error(covariance)
        if error > self._aim:
            return False
        if self.has_own and self._sums.left(every) > self.most:
            self.stage, self.restarts = RunStage.KNOWN, False
            return True
        same, self._aim = self.waits and self._is_same(change, covariance), error / 2.0
        self.restarts = self.waits and not same
        self.stage = RunStage.KNOWN if same or error <= LAST else RunStage.REFINED
        self._beside = np.append(np.zeros(len(change)), every[len(change) :])
        if same:
            return True
        sigmas = np.sqrt(np.diag(covariance)).tolist()
        self.found = tuple(map(self._value, self.terms.free, change.tolist(), sigmas))
        if all(value.within for value in self.found):
            self.values = {value.parameter: value.value for value in self.found}
            by = change - self._change
            self.refined = np.zeros(len(by)) if self.restarts else self.refined + by
            self._change, self.covariance = change, covariance
        else:
            self.stage = RunStage.KNOWN
        return True

    def _is_same(self, change: Array, covariance: Array) -> bool:
        """Whether what has shown after a rest is no other value: a drag, say."""
        if not self.has_own:
            return False
        apart = self.covariance + covariance
        return bool(change @ np.linalg.solve(apart, change) <= self._most)

    def _value(self, name: str, change: float, sigma: float) -> RunValue:
        low, high = self.ranges[name]
        value = self._base[name] + change
        return RunValue(name, value, sigma, low <= value <= high)


class _Sums:
    """Normal equations of so many parameters, by relations of so much least scatter."""

    def __init__(self, width: int, least: Array) -> None:
        self._information, self._vector = np.zeros((width, width)), np.zeros(width)
        self._squares, self._least = np.zeros((width, width)), least
        # The same in least sigmas: products with the values, and the squares of these.
        self._products: Array = np.zeros(width)
        self._sum = 0.0
        self.scans = 0

    def add(self, values: Array, slopes: Array, known: Flags, variance: Array) -> None:
        """Take a scan of those relations that are known."""
        used = slopes[known]
        weighed = used / variance[known, None]
        self._information = self._information + weighed.T @ used
        # A residual r at a value wants the parameter moved by -r / (dr/dp).
        self._vector = self._vector - weighed.T @ values[known]
        scaled, apart = used / self._least[known, None], values[known] / self._least[known]
        self._squares = self._squares + scaled.T @ scaled
        self._products = self._products + scaled.T @ apart
        self._sum += float(apart @ apart)
        self.scans += 1

    def solved(self, prior: Array, already: Array | None = None) -> tuple[Array, Array]:
        """The parameters, ``already`` changed by so much, and their covariance."""
        inverse = np.linalg.inv(self._information + prior)
        covariance: Array = np.asarray(inverse, dtype=np.float64)
        moved = 0.0 if already is None else self._information @ already
        return covariance @ (self._vector - moved), covariance

    def left(self, change: Array) -> float:
        """Root mean square over the scans of what these parameters leave, in least sigmas."""
        moved = float(change @ (2.0 * self._products + self._squares @ change))
        return math.sqrt(max(self._sum + moved, 0.0) / self.scans)

    def error(self, covariance: Array) -> float:
        """Root mean square over the scans of what the first parameters leave, in least sigmas."""
        count = len(covariance)
        return float(np.sqrt(np.sum(covariance * self._squares[:count, :count]) / self.scans))


def _first(count: int, values: Array, covariance: Array) -> tuple[Array, Array]:
    return values[:count], covariance[:count, :count]
