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

"""Tests of the coefficients that a calibration has limits for, on a stream of residuals.

``CoefficientShift`` of each residual takes rows of what a healthy unit may differ by, the residual
and its readings; here these rows are made.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence

import numpy as np
import numpy.typing as npt

from flea_diag.core.detection.coefficient_shift import COEFFICIENT_WINDOWS_S, CoefficientShift
from flea_diag.core.detection.mean_shift import MeanShiftLimit
from flea_diag.core.residual_values import ResidualRows
from flea_diag.core.residuals.residual_rows import ReadingTerm, ResidualSet
from flea_diag.core.running_mean import summed_in_order
from flea_diag.core.scan_counts import ScanCounts

Array = npt.NDArray[np.float64]

BESIDE_K = 20.0
"""Warming by which a magnet weakens by about what units differ by: 3 %, at 0.1 to 0.2 %/K."""


class CoefficientTests:
    """The coefficients that a calibration has limits for, on a stream of residuals.

    ``tests`` holds the column and the reading of each.
    """

    def __init__(
        self,
        known: ResidualSet,
        limits: Sequence[MeanShiftLimit],
        tolerance: Sequence[float],
        terms: Sequence[ReadingTerm],
        counts: ScanCounts,
        between: Mapping[str, float],
        metric: Array,
        ranges: Mapping[str, tuple[float, float]],
    ) -> None:
        self.windows = tuple(counts.of(time_s) for time_s in COEFFICIENT_WINDOWS_S)
        self._loads = len(metric)
        wanted = {(limit.name, limit.along) for limit in limits}
        terms = [term for term in terms if (term.residual, term.channel) in wanted]
        self.tests = [(known.place[term.residual], term.channel) for term in terms]
        self.k = np.full((len(terms), len(self.windows)), np.nan)
        sigmas = {}
        for limit in limits:
            test = known.place[limit.name], limit.along
            self.k[self.tests.index(test), self.windows.index(limit.window)] = limit.k
            sigmas[limit.name] = limit.sigma
        self._groups = [
            _Group(
                known,
                [term for term in terms if term.residual == name],
                tolerance,
                sigma,
                counts,
                metric * np.sqrt(between.get(name, 0.0)),
                ranges,
            )
            for name, sigma in sigmas.items()
        ]
        order = [(known.place[t.residual], t.channel) for g in self._groups for t in g.terms]
        self._order = [order.index(test) for test in self.tests]

    def step(
        self,
        rows: ResidualRows,
        change: Array,
        leverage: Array | None,
        loads: Array | None,
        supplied: Array | None,
    ) -> tuple[Array, Array]:
        """Z and shifts after each of n scans, each of shape (n, tests, windows).

        ``change`` of the unit's parameters is in the residuals, ``leverage``, shape
        (n, residuals), beyond the reach: what was not calibrated there is none of the unit.
        ``loads`` and ``supplied`` are as in ``MeanShiftTest.step``.
        """
        known = np.zeros((len(rows), self._loads)) if loads is None else np.nan_to_num(loads)
        found = [group.step(rows, change, leverage, known, supplied) for group in self._groups]
        joined = np.concatenate(found, axis=2)[:, :, self._order]
        return joined[:, 0], joined[:, 1]

    def turn(self, opened: bool) -> None:
        """An episode has opened: freeze what came before. Or closed: begin anew."""
        for group in self._groups:
            group.shift.freeze() if opened else group.shift.clear()

    def thaw(self, columns: Collection[int]) -> None:
        """In an episode: go on with the levels of these residuals."""
        for group in self._groups:
            group.shift.thaw(group.column in columns)


def neglected_by(loads: Array, weights: Array) -> Array:
    """What a residual neglects may follow each load, shape (n, loads)."""
    found = np.zeros(loads.shape)
    for place, column in enumerate(weights.T):
        found[:, place] = summed_in_order(loads * column)
    return found


def coefficient_rows(
    terms: Sequence[ReadingTerm],
    units: Array,
    loads: Array,
    supplied: Array | None,
    residual: Array,
    signals: Array,
) -> Array:
    """Rows of ``CoefficientShift.step`` of one residual, its psi as long as ``own_count`` says.

    ``units``, shape (n, units), is what its unit's parameters do within their tolerances, and
    ``loads``, shape (n, loads), what it may neglect under each load.
    """
    if supplied is None:
        supplied = np.zeros((len(units), 1 + max((k for _, k in terms[0].warmed), default=0)))
    warmed = [units[:, place] * supplied[:, k] for place, k in terms[0].warmed]
    beside = [units[:, place] * signals[:, k] / BESIDE_K for place, k in terms[0].beside]
    readings = [signals[:, term.signal] - term.zero for term in terms]
    return np.column_stack((units, loads, *warmed, *beside, residual, *readings))


def own_count(term: ReadingTerm, loads: int) -> int:
    """How many columns of ``coefficient_rows`` are psi."""
    return len(term.units) + loads + len(term.warmed) + len(term.beside)


class _Group:
    """Coefficients of one residual."""

    def __init__(
        self,
        known: ResidualSet,
        terms: Sequence[ReadingTerm],
        tolerance: Sequence[float],
        sigma: float,
        counts: ScanCounts,
        neglected: Array,
        ranges: Mapping[str, tuple[float, float]],
    ) -> None:
        self._neglected = neglected
        seen = [ranges.get(term.channel, (-np.inf, np.inf)) for term in terms]
        self._low, self._high = np.array(seen).T
        self.terms, self.column = terms, known.place[terms[0].residual]
        self._place = known.spreading.index(self.column)
        self._units = list(terms[0].units)
        self._tolerance = np.array(tolerance)[self._units]
        self._signals = [term.signal for term in terms]
        own = own_count(terms[0], len(neglected))
        self.shift = CoefficientShift(own, len(terms), sigma, counts=counts)

    def step(
        self,
        rows: ResidualRows,
        change: Array,
        leverage: Array | None,
        loads: Array,
        supplied: Array | None,
    ) -> Array:
        """``CoefficientShift.step`` of these rows, in motion and where its readings have been.

        At rest a reading tells its coefficient from nothing, and beyond what recordings hold of it
        nobody knows what the relation neglects. ``loads`` are 0 where one is not read.
        """
        spread = rows.spread[:, self._place]
        learned = summed_in_order(spread * change)
        readings = rows.signals[:, self._signals]
        moved = 0.0 if rows.moved is None else rows.moved[:, self.column]
        made = coefficient_rows(
            self.terms,
            spread[:, self._units] * self._tolerance,
            neglected_by(loads, self._neglected),
            supplied,
            rows.values[:, self.column] - moved - learned,
            rows.signals,
        )
        seen = (self._low <= readings) & (readings <= self._high)
        use = rows.moving & seen.all(axis=1)
        if leverage is not None:
            use = use & (leverage[:, self.column] <= 0.0)
        return self.shift.step(made, use & np.isfinite(made).all(axis=1))
