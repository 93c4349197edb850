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

import numpy as np
import numpy.typing as npt

from flea_diag.core.residual_bank import RESIDUALS, ResidualRow, ResidualSample
from flea_diag.core.running_mean import WindowedMeans
from flea_diag.core.thermal import CORRECTION_S

Array = npt.NDArray[np.float64]

SPEED_REGIONS_M_S = (0.025, 0.060)
"""Upper edges of the slow and the medium region of the mean |speed| in a window."""
THERMAL = ("motor_temperature", "nut_temperature", "ambient_temperature")
LOG_FLOOR = 1e-3
"""A noise level this small against nominal counts as none (a dead channel)."""


def speed_region(mean_speed_m_s: float) -> int:
    """0 slow, 1 medium, 2 fast."""
    return sum(mean_speed_m_s > edge for edge in SPEED_REGIONS_M_S)


def is_noise(row: ResidualRow) -> bool:
    """Noise levels are tested as a ratio to nominal, on a logarithmic scale."""
    return row.name.endswith("_noise")


@dataclass(frozen=True, slots=True)
class WindowLimit:
    """Nominal statistics of one residual's mean over ``window`` samples, per speed region.

    ``k`` is the limit of |z|; ``centre`` and ``sigma`` are in the residual's unit (natural
    logarithm of the ratio for noise levels).
    """

    window: int
    centre: tuple[float, ...]
    sigma: tuple[float, ...]
    k: float


@dataclass(frozen=True, slots=True)
class ResidualLimit:
    """Limits of one residual; ``sigma`` is the scatter of single samples, per region.

    ``nominal`` is the nominal noise level (noise residuals) and ``correlation_samples`` the
    number of samples that carry as much news as one independent sample. ``spread`` is d r / d
    theta of healthy units (order of ``UNIT_PARAMETERS``) where the residual itself does not
    tell it scan by scan, and empty elsewhere.
    """

    name: str
    windows: tuple[WindowLimit, ...]
    sigma: tuple[float, ...]
    nominal: float = 1.0
    correlation_samples: float = 1.0
    spread: tuple[float, ...] = ()


@dataclass(slots=True)
class TestResults:
    """The test nearest to its limit, for each residual (arrays in the order of RESIDUALS).

    ``z`` and its limit ``k``; ``mean`` is the statistic in the residual's unit (logarithm of
    the ratio for noise levels); ``window`` the samples behind it, 0 where nothing was tested.
    """

    z: Array
    k: Array
    mean: Array
    window: npt.NDArray[np.int64]

    @classmethod
    def untested(cls) -> TestResults:
        """No test has been made yet."""
        count = len(RESIDUALS)
        none = np.full(count, np.nan)
        return cls(none, none.copy(), none.copy(), np.zeros(count, dtype=np.int64))

    def deviating(self) -> npt.NDArray[np.bool_]:
        """Which residuals are beyond their limits; an untested one is not."""
        with np.errstate(invalid="ignore"):
            beyond: npt.NDArray[np.bool_] = np.abs(self.z) > self.k
        return beyond

    def symbol(self, index: int) -> str:
        """+, - or 0."""
        if not abs(self.z[index]) > self.k[index]:
            return "0"
        return "+" if self.z[index] > 0 else "-"


class Detector:
    """Runs every test of ``RESIDUALS`` on a stream of samples, constant memory."""

    def __init__(
        self,
        limits: Sequence[ResidualLimit],
        tolerance: Sequence[float],
        noise_log: float,
        thermal_rate_k_per_s: float,
    ) -> None:
        extra = noise_log, thermal_rate_k_per_s * CORRECTION_S
        named = {limit.name: limit for limit in limits}
        self._groups = tuple(
            _Group(gate, named, np.array(tolerance), extra) for gate in ("moving", "always")
        )
        self._jumps = [
            (j, named[row.name].windows[0])
            for j, row in enumerate(RESIDUALS)
            if row.gate == "jump" and row.name in named
        ]
        self.results = TestResults.untested()

    def step(self, sample: ResidualSample) -> TestResults:
        """Results after one more sample (the same object, updated, at every call)."""
        for group in self._groups:
            if group.gate == "always" or sample.moving:
                group.step(sample, self.results)
        for index, bound in self._jumps:
            value = sample.values[index]
            self.results.z[index] = (value - bound.centre[0]) / bound.sigma[0]
            self.results.k[index], self.results.mean[index] = bound.k, value
            self.results.window[index] = 1
        return self.results

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
        self.results.z[list(columns)] = np.nan

    def clear(self) -> None:
        """Drop every window (re-arming)."""
        self.forget(range(len(RESIDUALS)))


class _Group:
    """Residuals that are gated alike share one ring of rows: values, |speed|, spreads."""

    def __init__(
        self,
        gate: str,
        limits: dict[str, ResidualLimit],
        tolerance: Array,
        extra: tuple[float, float],
    ) -> None:
        self.gate = gate
        self._columns = np.array([j for j, row in enumerate(RESIDUALS) if row.gate == gate])
        rows = [RESIDUALS[j] for j in self._columns]
        self._windows = sorted({window for row in rows for window in row.windows})
        self._noise = np.array([is_noise(row) for row in rows])
        # Only parity relations have a spread; the others carry none through the ring.
        self._spread = np.array([j for j, row in enumerate(rows) if row.name.startswith("parity")])
        self.tolerance = tolerance
        noise_log, thermal_k = extra
        thermal = np.array([row.name in THERMAL for row in rows])
        self._variance = np.where(self._noise, noise_log**2, np.where(thermal, thermal_k**2, 0.0))
        self._fixed = np.zeros((len(rows), len(tolerance)))
        self._bounds(rows, limits)
        self._spread_rows = self._columns[self._spread] if len(self._spread) else self._spread
        self._noisy = np.flatnonzero(self._noise)
        self._based()
        self._lengths, self._order = np.array(self._windows), np.arange(len(rows))
        self._places = np.arange(len(self._windows))
        width = len(rows) + 1 + len(self._spread) * len(tolerance)
        self._row = np.zeros(width)
        self._means = WindowedMeans(width, self._windows)

    def _bounds(self, rows: list[ResidualRow], limits: dict[str, ResidualLimit]) -> None:
        shape = (len(self._windows), len(rows), len(SPEED_REGIONS_M_S) + 1)
        self._centre, self._sigma = np.zeros(shape), np.full(shape, np.nan)
        self._k = np.full(shape[:2], np.nan)
        self._nominal = np.ones(len(rows))
        for column, row in enumerate(rows):
            limit = limits.get(row.name)
            if limit is None:
                continue
            self._nominal[column] = limit.nominal
            if limit.spread:
                self._fixed[column] = limit.spread
            for bound in limit.windows:
                at = self._windows.index(bound.window), column
                self._centre[at], self._sigma[at], self._k[at] = bound.centre, bound.sigma, bound.k

    def _based(self) -> None:
        """What every window's variance holds whatever its samples were."""
        unit = np.square(self._fixed * self.tolerance).sum(axis=1)
        self._base = self._sigma**2 + (self._variance + unit)[None, :, None]

    def step(self, sample: ResidualSample, results: TestResults) -> None:
        """Take one sample and judge every window."""
        # A missing speed only matters to what needs it; the region then falls to slow.
        speed = abs(sample.signals.speed_m_s)
        count = len(self._columns)
        row = self._row
        row[:count] = sample.values[self._columns]
        row[count] = speed if speed == speed else 0.0
        if len(self._spread):
            spread = sample.spread[self._spread_rows].ravel()
            spread[np.isnan(spread)] = 0.0
            row[count + 1 :] = spread
        self._means.push(row)
        means = self._means.means()
        z, statistic = self._z(means[:, :count], means[:, count], means[:, count + 1 :])
        ratio = np.abs(z) / self._k
        ratio[np.isnan(ratio)] = -1.0
        nearest = ratio.argmax(axis=0)
        pick = nearest, self._order
        results.z[self._columns] = z[pick]
        results.k[self._columns] = self._k[pick]
        results.mean[self._columns] = statistic[pick]
        results.window[self._columns] = self._lengths[nearest]

    def _z(self, means: Array, speeds: Array, spreads: Array) -> tuple[Array, Array]:
        region = np.searchsorted(SPEED_REGIONS_M_S, np.where(np.isnan(speeds), 0.0, speeds))
        window = self._places
        statistic = means.copy()
        if len(self._noisy):
            ratio = means[:, self._noisy] / self._nominal[self._noisy]
            statistic[:, self._noisy] = np.log(np.maximum(ratio, LOG_FLOOR))
        variance = self._base[window, :, region]
        if len(self._spread):
            spreads = spreads.reshape(len(window), len(self._spread), len(self.tolerance))
            variance[:, self._spread] += np.square(spreads * self.tolerance).sum(axis=2)
        z: Array = (statistic - self._centre[window, :, region]) / np.sqrt(variance)
        return z, statistic

    def adopt(self, change: Array, tolerance: Array) -> None:
        """Move the parity residuals in the windows along with the unit's parameters."""
        self.tolerance = tolerance
        self._based()
        count = len(self._columns)
        for place, column in enumerate(self._spread):
            start = count + 1 + place * len(change)
            self._means.combine(int(column), slice(start, start + len(change)), change)

    def forget(self, columns: Sequence[int]) -> None:
        """Clear the windows of some residuals."""
        mine = [int(np.flatnonzero(self._columns == c)[0]) for c in columns if c in self._columns]
        self._means.clear(mine)
