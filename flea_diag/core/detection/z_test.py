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

"""Z-tests on windowed means of residuals with a common gate; see ``detection``."""

from __future__ import annotations

from collections.abc import Collection, Sequence

import numpy as np
import numpy.typing as npt

from flea_diag.core.detection.window_limit import SPEED_REGIONS_M_S, ResidualLimit
from flea_diag.core.detection.z_test_loops import Group
from flea_diag.core.flat_state import FlatState
from flea_diag.core.residual_values import ResidualRows
from flea_diag.core.residuals.residual_rows import ResidualRow, ResidualSet
from flea_diag.core.running_mean import WindowedMeans, summed_in_order
from flea_diag.core.scan_counts import ScanCounts

Array = npt.NDArray[np.float64]
Flags = npt.NDArray[np.bool_]

REGION_EDGES = np.array(SPEED_REGIONS_M_S)


class ZTests:
    """Z-tests of the residuals of one gate, on one ring of rows.

    A row holds values, growth, |speed|, spreads. The variance of a mean is that of the calibration
    times the mean growth over its samples: what cancels in a mean, such as the lag of one speed
    behind another, still does where single samples scatter more.
    A gated group takes no samples at rest and keeps the results of the last scan in motion.
    Results are z, its limit, its window and its growth (``detection.TestResults``).
    """

    def __init__(
        self,
        known: ResidualSet,
        gate: str,
        limits: dict[str, ResidualLimit],
        tolerance: Array,
        thermal_variance: float,
        counts: ScanCounts,
    ) -> None:
        self._gated = gate == "moving"
        every = enumerate(known.rows)
        columns = [j for j, row in every if row.gate == gate and row.name in limits]
        # Those in which healthy units differ side by side, whatever stands between them.
        columns = _together(columns, known.spreading)
        rows = [known.rows[j] for j in columns]
        self._columns = np.array(columns, dtype=int)
        self._windows = sorted({counts.of(time_s) for row in rows for time_s in row.windows_s}) or [
            1
        ]
        # Where healthy units differ: their columns here, and their places in a row's spread.
        differing = known.spreading
        self._spread = [c for c, j in enumerate(columns) if j in differing]
        first = self._spread[0] if self._spread else 0
        self._spreading = slice(first, first + len(self._spread))
        self._places = np.array([differing.index(columns[c]) for c in self._spread], dtype=int)
        self._fixed = np.zeros((len(rows), len(tolerance)))
        held = np.full((4, len(rows)), np.nan)
        held[2:] = np.array([[0.0], [1.0]])
        which = {"gated": self._gated, "columns": columns, "places": self._places, "first": first}
        self._state = FlatState({"held": held, "tolerance": tolerance}, which)
        self._extra = np.array([thermal_variance * (row.name in known.predictions) for row in rows])
        self._bound(rows, limits)
        self._based()
        self._lengths = np.array(self._windows)
        self._window, self._order = np.arange(len(self._windows)), np.arange(len(rows))
        width = 2 * len(rows) + 1 + len(self._spread) * len(tolerance)
        # What the kernel bridges. An innovation knows nothing of the noise that a gap costs.
        gaps = np.zeros(width, dtype=np.int64)
        gaps[: len(rows)] = [counts.kernel // 2 * (r.name not in known.innovations) for r in rows]
        self._means = WindowedMeans(width, self._windows, gaps)

    @property
    def _held(self) -> Array:
        """The last results."""
        return self._state.table["held"]

    @property
    def _tolerance(self) -> Array:
        """What healthy units differ by."""
        return self._state.table["tolerance"]

    def _bound(self, rows: list[ResidualRow], limits: dict[str, ResidualLimit]) -> None:
        """Centre, variance and limit of each test, shape (3, regions, windows, residuals)."""
        shape = (len(SPEED_REGIONS_M_S) + 1, len(self._windows), len(rows))
        self._bounds = np.full((3, *shape), np.nan)
        self._own = self._bounds[1].copy()
        for column, row in enumerate(rows):
            limit = limits[row.name]
            if limit.spread:
                self._fixed[column, : len(limit.spread)] = limit.spread
            for bound in limit.windows:
                window = self._windows.index(bound.window)
                self._bounds[0, :, window, column] = bound.centre
                self._own[:, window, column] = np.square(bound.sigma)
                self._bounds[2, :, window, column] = bound.k

    def _based(self) -> None:
        """Part of each variance that does not depend on the samples in the window."""
        unit = np.square(self._fixed * self._tolerance).sum(axis=1)
        self._bounds[1] = self._own + (self._extra + unit)

    def step(self, rows: ResidualRows, growth: Array, results: Array) -> None:
        """Take rows; the test of each residual nearest to its limit goes into ``results``.

        ``results`` has shape (4, n, residuals), ``growth`` (n, residuals).
        """
        if not len(self._columns):
            return
        taken = rows.moving if self._gated else np.ones(len(rows), dtype=bool)
        found = self._held[:, None]
        if taken.any():
            found = np.concatenate((found, self._judge(self._table(rows, growth)[taken])), axis=1)
        self._held[:] = found[:, -1]
        results[:, :, self._columns] = found.take(np.cumsum(taken), axis=1)

    def group(self) -> Group:
        """What ``z_test_loops`` takes in place of ``step``."""
        return self._means.memory(), self._bounds, self._state.flat

    def _table(self, rows: ResidualRows, growth: Array) -> Array:
        """Rows of the ring, shape (n, width)."""
        count = len(self._columns)
        speed = 2 * count
        table = np.empty((len(rows), speed + 1 + len(self._spread) * len(self._tolerance)))
        table[:, :count] = rows.values.take(self._columns, axis=1)
        table[:, count:speed] = growth.take(self._columns, axis=1)
        table[:, speed] = np.abs(rows.speed_m_s)
        table[:, speed + 1 :] = rows.spread.take(self._places, axis=1).reshape(len(rows), -1)
        # A missing speed matters only to residuals that need it; the region defaults to slow.
        loose = table[:, speed:]
        loose[np.isnan(loose)] = 0.0
        return table

    def _judge(self, table: Array) -> Array:
        """Results after each row, shape (4, n, residuals of the group)."""
        count = len(self._columns)
        means = self._means.push(table)
        statistic, (centre, variance, k) = self._moments(means, count)
        z = (statistic - centre) / np.sqrt(variance)
        # A window without z ranks last.
        nearest = np.fmax(np.abs(z) / k, -1.0).argmax(axis=1)
        pick = np.arange(len(table))[:, None], nearest, self._order
        growth = np.sqrt(means[:, :, count : 2 * count][pick])
        return np.stack((z[pick], k[pick], self._lengths[nearest], growth))

    def _moments(self, means: Array, count: int) -> tuple[Array, Array]:
        """Statistic, shape (n, windows, residuals), and centre, variance and limit of each."""
        statistic, speeds = means[:, :, :count], means[:, :, 2 * count]
        region = REGION_EDGES.searchsorted(np.fmax(speeds, 0.0))
        bounds = self._bounds[:, region, self._window]
        bounds[1] *= means[:, :, count : 2 * count]
        if self._spread:
            shape = (*speeds.shape, len(self._spread), len(self._tolerance))
            spreads = means[:, :, 2 * count + 1 :].reshape(shape) * self._tolerance
            bounds[1][:, :, self._spreading] += summed_in_order(np.square(spreads))
        return statistic, bounds

    def adopt(self, change: Array, tolerance: Array) -> None:
        """Correct the parity residuals in the windows for changed unit parameters."""
        self._tolerance[:] = tolerance
        self._based()
        start = 2 * len(self._columns) + 1
        for column in self._spread:
            self._means.combine(column, slice(start, start + len(change)), change)
            start += len(change)

    def forget(self, columns: Sequence[int]) -> None:
        """Clear the windows of some residuals."""
        mine = [int(np.flatnonzero(self._columns == c)[0]) for c in columns if c in self._columns]
        self._means.clear(mine)
        self._held[0, mine] = np.nan


def _together(columns: list[int], wanted: Collection[int]) -> list[int]:
    """Columns in their order, but with the wanted ones side by side where the first of them is."""
    some = [column for column in columns if column in wanted]
    before = [column for column in columns if some and column < some[0]]
    return [*before, *some, *(c for c in columns if c not in wanted and c not in before)]
