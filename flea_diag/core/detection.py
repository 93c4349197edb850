"""Two-sided robust Z-tests on windowed residual means, thresholds from nominal recordings.

For residual j and window w the statistic is the mean m of its last w valid samples, and

    z = (m - centre) / sqrt(sigma_w^2 + sum_p (tolerance_p * mean dr/dp)^2),   |z| > k_w  ->  symbol

sigma_w is the rms of that mean over nominal recordings (in the speed region of the window),
so coloured model error is in it: the "robust" E of the Z-test. The sum is what another
healthy unit of the same design may differ by. k_w is the Student quantile that gives the
stated false-alarm rate. (Z-test: Mosterman and Biswas 1999; Narasimhan et al. 2010, 3.1.)
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from flea_diag.core.residual_bank import (
    RESIDUALS,
    SPREAD_ROWS,
    ResidualRow,
    ResidualRows,
    together,
)
from flea_diag.core.running_mean import WindowedMeans
from flea_diag.core.thermal import CORRECTION_S

Array = npt.NDArray[np.float64]

SPEED_REGIONS_M_S = (0.025, 0.060)
"""Upper edges of the slow and the medium region of the mean |speed| in a window."""
REGION_EDGES = np.array(SPEED_REGIONS_M_S)
THERMAL = ("motor_temperature", "nut_temperature", "ambient_temperature")


def speed_region(mean_speed_m_s: float) -> int:
    """0 slow, 1 medium, 2 fast."""
    return sum(mean_speed_m_s > edge for edge in SPEED_REGIONS_M_S)


@dataclass(frozen=True, slots=True)
class WindowLimit:
    """Nominal statistics of one residual's mean over ``window`` samples, per speed region.

    ``k`` is the limit of |z|; ``centre`` and ``sigma`` are in the residual's unit.
    """

    window: int
    centre: tuple[float, ...]
    sigma: tuple[float, ...]
    k: float


@dataclass(frozen=True, slots=True)
class ResidualLimit:
    """Limits of one residual; ``sigma`` is the scatter of single samples, per region.

    ``correlation_samples`` is the number of samples that carry as much news as one independent
    sample. ``spread`` is d r / d theta of healthy units (order of ``UNIT_PARAMETERS``) where the
    residual itself does not tell it scan by scan, and empty elsewhere.
    """

    name: str
    windows: tuple[WindowLimit, ...]
    sigma: tuple[float, ...]
    correlation_samples: float = 1.0
    spread: tuple[float, ...] = ()


@dataclass(slots=True)
class TestResults:
    """The test nearest to its limit of each residual after each scan, shape (n, residuals).

    ``z`` and its limit ``k``; ``mean`` is the statistic in the residual's unit; ``window`` the
    samples behind it, 0 where nothing was tested.
    """

    z: Array
    k: Array
    mean: Array
    window: npt.NDArray[np.int64]

    @classmethod
    def untested(cls, scans: int = 1) -> TestResults:
        """No test has been made yet."""
        return cls.none(scans, len(RESIDUALS))

    @classmethod
    def none(cls, scans: int, residuals: int) -> TestResults:
        """NaN for so many residuals."""
        z, k, mean = np.full((3, scans, residuals), np.nan)
        return cls(z, k, mean, np.zeros(z.shape, dtype=np.int64))

    def then(self, later: TestResults) -> TestResults:
        """These, and later ones after them."""
        pairs = zip(self._columns(), later._columns(), strict=True)
        return TestResults(*(np.concatenate(pair) for pair in pairs))

    def at(self, scans: Any) -> TestResults:
        """Results after these scans alone."""
        return TestResults(*(column[scans] for column in self._columns()))

    def _columns(self) -> tuple[Any, ...]:
        return self.z, self.k, self.mean, self.window

    def deviating(self) -> npt.NDArray[np.bool_]:
        """Which residuals are beyond their limits; an untested one is not."""
        beyond: npt.NDArray[np.bool_] = np.abs(self.z) > self.k
        return beyond

    def symbol(self, index: int) -> str:
        """+, - or 0, after the last scan."""
        z, k = self.z[-1, index], self.k[-1, index]
        return "0" if not abs(z) > k else "+" if z > 0 else "-"


class Detector:
    """Runs every test of ``RESIDUALS`` on a stream of residuals, constant memory."""

    def __init__(
        self,
        limits: Sequence[ResidualLimit],
        tolerance: Sequence[float],
        thermal_rate_k_per_s: float,
    ) -> None:
        extra = (thermal_rate_k_per_s * CORRECTION_S) ** 2
        named = {limit.name: limit for limit in limits}
        self._groups = tuple(
            _Group(gate, named, np.array(tolerance), extra) for gate in ("moving", "always")
        )

    def step(self, rows: ResidualRows) -> TestResults:
        """Results after each of these rows."""
        results = TestResults.untested(len(rows))
        for group in self._groups:
            group.step(rows, results)
        return results

    def adopt(self, change: Sequence[float], tolerance: Sequence[float]) -> None:
        """Go on with unit parameters that changed by ``change`` and a narrower spread.

        What the windows hold is moved along, r + (dr/dp) dp, so that nothing is forgotten.
        """
        for group in self._groups:
            group.adopt(np.array(change), np.array(tolerance))

    def forget(self, columns: Sequence[int]) -> None:
        """Drop the windows of some residuals, whose channel turned out to be bad."""
        for group in self._groups:
            group.forget(columns)

    def clear(self) -> None:
        """Drop every window (re-arming)."""
        self.forget(range(len(RESIDUALS)))


class _Group:
    """Residuals that are gated alike share one ring of rows: values, |speed|, spreads.

    At rest a gated group takes nothing in and keeps the verdict of the last scan in motion.
    """

    def __init__(
        self,
        gate: str,
        limits: dict[str, ResidualLimit],
        tolerance: Array,
        thermal_variance: float,
    ) -> None:
        self._gated = gate == "moving"
        columns = [j for j, row in enumerate(RESIDUALS) if row.gate == gate and row.name in limits]
        rows = [RESIDUALS[j] for j in columns]
        self._columns = np.array(columns, dtype=int)
        self._windows = sorted({window for row in rows for window in row.windows}) or [1]
        # Where healthy units differ: their columns here, and their places in a row's spread.
        self._spread = [c for c, j in enumerate(columns) if j in SPREAD_ROWS]
        self._spreading = together(self._spread)
        self._places = [SPREAD_ROWS.index(columns[c]) for c in self._spread]
        self._tolerance = tolerance
        self._fixed = np.zeros((len(rows), len(tolerance)))
        self._extra = np.array([thermal_variance * (row.name in THERMAL) for row in rows])
        self._bounds(rows, limits)
        self._based()
        self._lengths = np.array(self._windows)
        self._window, self._order = np.arange(len(self._windows)), np.arange(len(rows))
        width = len(rows) + 1 + len(self._spread) * len(tolerance)
        self._means = WindowedMeans(width, self._windows)
        self._held = TestResults.none(1, len(rows))

    def _bounds(self, rows: list[ResidualRow], limits: dict[str, ResidualLimit]) -> None:
        """Tables of centre, variance and limit, shape (regions, windows, residuals)."""
        shape = (len(SPEED_REGIONS_M_S) + 1, len(self._windows), len(rows))
        self._centre, self._own = np.zeros(shape), np.full(shape, np.nan)
        self._k = np.full(shape[1:], np.nan)
        for column, row in enumerate(rows):
            limit = limits[row.name]
            if limit.spread:
                self._fixed[column] = limit.spread
            for bound in limit.windows:
                window = self._windows.index(bound.window)
                self._centre[:, window, column] = bound.centre
                self._own[:, window, column] = np.square(bound.sigma)
                self._k[window, column] = bound.k

    def _based(self) -> None:
        """What every window's variance holds whatever its samples were."""
        unit = np.square(self._fixed * self._tolerance).sum(axis=1)
        self._variance = self._own + (self._extra + unit)

    def step(self, rows: ResidualRows, results: TestResults) -> None:
        """Take the rows in and judge every window after each of them."""
        if not len(self._columns):
            return
        if not self._gated or rows.moving.all():
            found = self._judge(self._table(rows))
        elif rows.moving.any():
            found = self._held.then(self._judge(self._table(rows)[rows.moving]))
            found = found.at(np.cumsum(rows.moving))
        else:
            found = self._held.at(np.zeros(len(rows), dtype=int))
        self._held = found if len(found.z) == 1 else found.at(slice(-1, None))
        results.z[:, self._columns] = found.z
        results.k[:, self._columns] = found.k
        results.mean[:, self._columns] = found.mean
        results.window[:, self._columns] = found.window

    def _table(self, rows: ResidualRows) -> Array:
        """Rows of the ring: values, |speed|, spreads; shape (n, width)."""
        count, units = len(self._columns), len(self._tolerance)
        table = np.empty((len(rows), count + 1 + len(self._spread) * units))
        table[:, :count] = rows.values.take(self._columns, axis=1)
        loose = table[:, count:]
        loose[:, 0] = np.abs(rows.signals.speed_m_s)
        for number, place in enumerate(self._places):
            loose[:, 1 + number * units : 1 + (number + 1) * units] = rows.spread[:, place]
        # A missing speed only matters to what needs it; the region then falls to slow.
        loose[np.isnan(loose)] = 0.0
        return table

    def _judge(self, table: Array) -> TestResults:
        """The test nearest to its limit of each residual, after each row of the ring."""
        count = len(self._columns)
        means = self._means.push(table)
        statistic, centre, variance = self._moments(means, count)
        z = (statistic - centre) / np.sqrt(variance)
        # An untested window has no z: it is farthest from its limit.
        nearest = np.fmax(np.abs(z) / self._k, -1.0).argmax(axis=1)
        pick = np.arange(len(table))[:, None], nearest, self._order
        return TestResults(
            z[pick], self._k[nearest, self._order], statistic[pick], self._lengths[nearest]
        )

    def _moments(self, means: Array, count: int) -> tuple[Array, Array, Array]:
        """Statistic, centre and variance of each test, shape (n, windows, residuals)."""
        statistic, speeds = means[:, :, :count], means[:, :, count]
        region = REGION_EDGES.searchsorted(np.fmax(speeds, 0.0))
        variance = self._variance[region, self._window]
        if self._spread:
            shape = (*speeds.shape, len(self._spread), len(self._tolerance))
            spreads = means[:, :, count + 1 :].reshape(shape) * self._tolerance
            variance[:, :, self._spreading] += np.add.reduce(np.square(spreads), axis=3)
        return statistic, self._centre[region, self._window], variance

    def adopt(self, change: Array, tolerance: Array) -> None:
        """Move the parity residuals in the windows along with the unit's parameters."""
        self._tolerance = tolerance
        self._based()
        start = len(self._columns) + 1
        for column in self._spread:
            self._means.combine(column, slice(start, start + len(change)), change)
            start += len(change)

    def forget(self, columns: Sequence[int]) -> None:
        """Clear the windows of some residuals."""
        mine = [int(np.flatnonzero(self._columns == c)[0]) for c in columns if c in self._columns]
        self._means.clear(mine)
        self._held.z[:, mine] = np.nan
