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

"""Mean-shift tests on a stream of residuals, besides the Z-tests against the calibration.

The zero of an uncorroborated voltage drifts: its shift alone is no evidence.
A current that reads b too much moves the electrical relation by -R b and the mechanical one by
K b, so the load cell is a witness: where the two deviate in opposite directions, their common
distance from zero is held against the limit that the shift alone would have, and both deviate.
A witness adds no more than the voltage says itself: a drag alone is none.

Where the coefficient of a residual on a reading shifts (``coefficient_shift``), the residual
changes its sign with that reading, and with the side on which the motor works: a resistance that
has risen adds to the voltage while it drives, and takes from it while it brakes. So it deviates
without a sign (``symbols.ANY``).
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from types import MappingProxyType

import numpy as np
import numpy.typing as npt

from flea_diag.core import backend as backends
from flea_diag.core.detection.coefficient_tests import CoefficientTests
from flea_diag.core.detection.detection import TestResults
from flea_diag.core.detection.mean_shift import MeanShift, MeanShiftLimit
from flea_diag.core.detection.mean_shift_loops import MEAN_SHIFT_LOOPS, ShiftInput
from flea_diag.core.flat_state import FlatState
from flea_diag.core.residual_values import ResidualRows
from flea_diag.core.residuals.residual_rows import ReadingTerm, ResidualSet
from flea_diag.core.running_mean import summed_in_order
from flea_diag.core.scan_counts import ScanCounts

Array = npt.NDArray[np.float64]
Flags = npt.NDArray[np.bool_]

WITNESS = 2.0
"""Least deviation of the mechanical relation, in sigmas, that makes it a witness."""


class MeanShiftTest:
    """Runs every test that the calibration has a limit for.

    They are of residuals in which units differ: the run's own level is a better reference than the
    calibration. ``terms``: the readings that a limit may be along, ``ranges``: what recordings hold
    of them.
    """

    def __init__(
        self,
        known: ResidualSet,
        limits: Sequence[MeanShiftLimit],
        tolerance: Sequence[float],
        backend: str = "auto",
        *,
        counts: ScanCounts,
        terms: Sequence[ReadingTerm] = (),
        between: Mapping[str, float] = MappingProxyType({}),
        metric: Array | None = None,
        ranges: Mapping[str, tuple[float, float]] = MappingProxyType({}),
    ) -> None:
        self._electrical, self._mechanical = map(known.column, (known.circuit, known.friction))
        # Not used for a drag that may come with a change of unit.
        self._circuit = set(known.of_relation(known.circuit))
        self._need_voltage = set(known.needing(known.voltage))
        self._compiled = backends.chosen(backend) == "numba"
        self._tolerance = np.array(tolerance)
        self._open = self._is_other = False
        """Whether an episode is open, and may be of another unit: no shift has opened it."""
        self._fired: list[int] = []
        self._openers: list[int] = []
        """Columns whose shift has just exceeded its limit, and those that opened the episode."""
        coefficients = [limit for limit in limits if limit.along]
        limits = [limit for limit in limits if not limit.along]
        names = list(dict.fromkeys(limit.name for limit in limits))
        self._columns = np.array(known.columns(names), dtype=int)
        self._places = np.array([known.spreading.index(j) for j in self._columns], dtype=int)
        self._gated = np.array([known.named[n].gate == "moving" for n in names], dtype=bool)
        self._metric = np.empty((0, 0)) if metric is None else metric
        self._coefficients = (
            CoefficientTests(
                known, coefficients, tolerance, terms, counts, between, self._metric, ranges
            )
            if coefficients
            else None
        )
        self._units = 1 + len(tolerance)
        width = self._units + len(self._metric) + 1
        self._level = MeanShift(self._gated.tolist(), width, 1, counts=counts)
        windows = self._windows = tuple(self._level.windows.tolist())
        # A NaN limit is never exceeded.
        self._variance, self._k = np.full((2, len(names), len(windows)), np.nan)
        for limit in limits:
            at = names.index(limit.name), windows.index(limit.window)
            self._variance[at], self._k[at] = limit.sigma**2, limit.k
        apart = [between.get(name, 0.0) for name in names]
        self._between = np.fmax(np.nanmax(self._variance, axis=1), apart)
        self._state = FlatState(
            {
                "change": np.zeros(len(tolerance)), "tolerance": self._tolerance,
                "metric": self._metric, "variance": self._variance, "between": self._between,
                "k": self._k,
            },
            {"columns": self._columns, "places": self._places, "gated": self._gated},
        )  # fmt: skip
        self._nowhere = np.zeros((1, len(self._metric))), np.zeros((1, len(known.rows)))

    @property
    def _change(self) -> Array:
        """Change of the unit's parameters."""
        return self._state.table["change"]

    def adopt(self, change: Sequence[float]) -> None:
        """Set the change of the unit's parameters; levels are corrected for it."""
        self._change[:] = change

    def turn(self, opened: bool, same_unit: bool = False) -> None:
        """An episode has opened: freeze the level before it. Or closed: start a new level.

        ``same_unit``: with what opened it no other unit may have come.
        """
        self._open, self._openers = opened, self._fired if opened else []
        self._is_other = opened and not (self._openers or same_unit)
        self._level.freeze() if opened else self._level.clear()
        if self._coefficients:
            self._coefficients.turn(opened)

    def thaw(self, columns: Collection[int]) -> None:
        """In an episode: go on with the levels of these residuals, and with no others."""
        self._level.thaw([column in columns for column in self._columns.tolist()])
        if self._coefficients:
            self._coefficients.thaw(columns)

    def input(
        self,
        count: int,
        leverage: Array | None = None,
        loads: Array | None = None,
        moved: Array | None = None,
    ) -> ShiftInput | None:
        """What compiled loops take to judge means of n scans; None where none are compiled.

        ``moved``: see ``ResidualRows``.
        """
        if not self._compiled:
            return None
        by = self._nowhere[1] if moved is None else moved
        place, found = (*self._place(leverage, loads), by), np.empty((2, count, *self._k.shape))
        return not self._is_other, place, self._state.flat, self._level.room(count), found

    def _place(self, leverage: Array | None, loads: Array | None) -> tuple[Array, Array]:
        """Loads, shape (n or 1, loads), and leverages, shape (n or 1, residuals)."""
        anyload, anywhere = self._nowhere
        return anyload if loads is None else loads, anywhere if leverage is None else leverage

    def step(
        self,
        rows: ResidualRows,
        results: TestResults,
        alone: Flags | None,
        leverage: Array | None = None,
        loads: Array | None = None,
        supplied: Array | None = None,
        judged: ShiftInput | None = None,
    ) -> None:
        """Where a shift is beyond its limit and no other test of its residual is, it counts.

        In an episode that no shift has opened it says nothing: the fault may have come with
        another unit, whose level is another. With an error of a reading none comes. Nor does the
        circuit's say anything where a shift of the forces alone opened it: that drag, too, may be
        another unit's, with its winding. A voltage that stands ``alone``, shape (n,), None:
        nowhere, needs a witness to open one, and says nothing in one that anything else has opened.
        ``leverage``, shape (n, residuals), is that beyond the reach, and ``loads`` has shape
        (n, loads), NaN where one is not read; None: nowhere.
        ``supplied`` is ``Heating`` of each predicted store; None: not known. ``judged`` is what
        ``Detector`` was given to judge means by, if it was.
        """
        self._fired = []
        if self._is_other:
            return
        if judged is not None:
            (z, shifts), beyond = judged[-1], results.shifted
        else:
            follow = self._follow if self._compiled else self._z
            z, shifts, beyond = follow(rows, leverage, loads)
        if beyond or alone is not None:
            self._judge_means(results, alone, z, shifts)
        if self._coefficients:
            found = self._coefficients.step(rows, self._change, leverage, loads, supplied)
            self._judge_coefficients(self._coefficients, results, alone, *found)

    def _silent(self, column: int) -> bool:
        """Whether a residual of the circuit says nothing in this episode."""
        of_forces = bool(self._openers) and self._circuit.isdisjoint(self._openers)
        return of_forces and column in self._circuit

    def _judge_means(
        self, results: TestResults, alone: Flags | None, z: Array, shifts: Array
    ) -> None:
        """Shifts of means."""
        for test, column in enumerate(self._columns.tolist()):
            if self._silent(column):
                continue
            here = z[:, test]
            if alone is not None and column in self._need_voltage:
                heard = self._witnessed(here, column, results)
                here = np.where(alone[:, None], heard, here)
            limits = self._windows, self._k[test]
            counts = self._judge(here, column, limits, results, shifts[:, test])
            if counts[-1]:
                self._fired.append(column)
            if alone is not None and column == self._electrical:
                self._call_witness(counts & alone, results)

    def _judge_coefficients(
        self,
        tests: CoefficientTests,
        results: TestResults,
        alone: Flags | None,
        z: Array,
        shifts: Array,
    ) -> None:
        """Shifts of coefficients."""
        if not (np.abs(z) > tests.k).any():
            return
        for test, (column, along) in enumerate(tests.tests):
            if self._silent(column):
                continue
            here, shift = z[:, test], shifts[:, test]
            if alone is not None and column in self._need_voltage:
                here = np.where(alone[:, None], np.nan, here)
            counts = self._judge(here, column, (tests.windows, tests.k[test]), results, shift)
            if counts.any():
                results.along[column] = along, counts | ~np.asarray(results.signed(column))
            if counts[-1]:
                self._fired.append(column)

    def _follow(
        self, rows: ResidualRows, leverage: Array | None, loads: Array | None
    ) -> tuple[Array, Array, bool]:
        """``_z`` in one compiled loop."""
        given = self.input(len(rows), leverage, loads, rows.moved)
        assert given is not None
        loops = backends.exact(*MEAN_SHIFT_LOOPS)
        beyond = loops((rows.values, rows.spread, rows.moving), *given[1:])
        return *given[-1], beyond

    def _z(
        self, rows: ResidualRows, leverage: Array | None, loads: Array | None
    ) -> tuple[Array, Array, bool]:
        """Every shift, in sigmas of itself and of what units differ by, and as it is.

        Both of shape (n, residuals, windows); then whether any is beyond its limit.
        """
        loads, leverage = self._place(leverage, loads)
        # The residuals as if nothing had been learned of the unit nor made more exact of the run,
        # and what units differ by.
        spread = rows.spread.take(self._places, axis=1)
        values = np.empty((*spread.shape[:2], self._level.columns))
        learned = summed_in_order(spread * self._change)
        moved = self._nowhere[1] if rows.moved is None else rows.moved
        values[:, :, 0] = (rows.values - moved).take(self._columns, axis=1) - learned
        values[:, :, 1 : self._units] = spread * self._tolerance
        known = np.where(np.isnan(loads), 0.0, loads)
        for place, weights in enumerate(self._metric.T, start=self._units):
            values[:, :, place] = summed_in_order(known * weights)[:, None]
        values[:, :, -1] = leverage.take(self._columns, axis=1)
        every = self._level.step(values, rows.moving[:, None] | ~self._gated)
        unit = summed_in_order(np.square(every[..., 1 : self._units]))
        apart = every[..., -1]
        for load in range(len(self._metric)):
            apart = apart + np.square(every[..., self._units + load])
        variance = self._variance + self._between[:, None] * apart + unit
        z = every[..., 0] / np.sqrt(variance)
        return z, every[..., 0], bool((np.abs(z) > self._k).any())

    def _witnessed(self, z: Array, column: int, results: TestResults) -> Array:
        """What the shift of a voltage that stands alone amounts to, NaN where to nothing."""
        if column == self._electrical and column in self._openers:
            return z
        if column != self._electrical or self._open or self._mechanical < 0:
            return np.full_like(z, np.nan)
        force = results.z[:, self._mechanical, None]
        speaks = (np.abs(force) > WITNESS) & (force * z < 0.0)
        added = np.minimum(np.abs(force), np.abs(z))
        return np.where(speaks, np.copysign(np.hypot(z, added), z), np.nan)

    def _call_witness(self, beyond: Flags, results: TestResults) -> None:
        """What opens an episode with a witness is a deviation of both relations."""
        if self._open or not beyond.any():
            return
        circuit, forces = self._electrical, self._mechanical
        called = beyond & ~(np.abs(results.z[:, forces]) > results.k[:, forces])
        both, k = results.z[called, circuit], results.k[called, circuit]
        results.z[called, forces], results.k[called, forces] = -both, k

    def _judge(
        self,
        z: Array,
        column: int,
        limits: tuple[Sequence[int], Array],
        results: TestResults,
        shifts: Array,
    ) -> Flags:
        """Fill the results in; after which scans a shift counts. ``limits``: windows, and k."""
        windows, k = limits
        counts = np.zeros(len(z), dtype=bool)
        if not (np.abs(z) > k).any():
            return counts
        quiet = ~(np.abs(results.z[:, column]) > results.k[:, column])
        for each, shift, limit, window in zip(z.T, shifts.T, k, windows, strict=True):
            beyond = quiet & (np.abs(each) > limit)
            results.z[beyond, column], results.k[beyond, column] = each[beyond], limit
            results.window[beyond, column] = window
            results.shift[beyond, column] = shift[beyond]
            counts |= beyond
        return counts
