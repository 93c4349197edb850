"""Limits of every residual from nominal recordings, for a stated false-alarm rate.

The scatter of a windowed mean is measured on the recordings, so it includes the coloured model
error and the differences between runs. The limit k is the Student quantile for the share of the
false-alarm rate allotted to one test of one window. Its degrees of freedom are the number of
ten-second pieces of nominal recording. It is never below ``GUARD`` times the largest nominal value.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from types import MappingProxyType

import numpy as np
import numpy.typing as npt

from flea_diag.core.calibration.calibration import BadStretch, NominalRun
from flea_diag.core.calibration.identification import Identified
from flea_diag.core.detection.mean_shift import SHIFT_WINDOWS, MeanShift, MeanShiftLimit, limit_of
from flea_diag.core.detection.window_limit import SPEED_REGIONS_M_S, ResidualLimit, WindowLimit
from flea_diag.core.residuals.channel_units import COMMAND, VOLTAGE
from flea_diag.core.residuals.plausibility import ENTER_SAMPLES, usable
from flea_diag.core.residuals.relation_set import RelationSet
from flea_diag.core.residuals.residual_bank import ResidualBank
from flea_diag.core.residuals.residual_rows import ResidualRow, ResidualSet
from flea_diag.core.sensors.sensor_limits import SENSOR_SHARE

Array = npt.NDArray[np.float64]

GUARD = 1.25
PIECE_S = 10.0
SHIFT_SHARE = 0.1
"""Share of the false-alarm rate allotted to mean-shift tests."""
REGIONS = len(SPEED_REGIONS_M_S) + 1


@dataclass(frozen=True)
class Trace:
    """Residuals of one nominal recording; values shape (scans, residuals), order of ``rows``."""

    name: str
    rows: ResidualSet
    values: Array
    speed_m_s: Array
    moving: npt.NDArray[np.bool_]
    voltage_usable: npt.NDArray[np.bool_]


def trace(
    run: NominalRun,
    identified: Identified,
    relations: RelationSet,
    kernel_length: int,
    period_s: float,
) -> Trace:
    """Run one recording through the residual bank, without intervals of bad voltage."""
    bank = ResidualBank(
        identified.parameters, relations, period_s=period_s, kernel_length=kernel_length
    )
    residuals = bank.step(run.rows, frozen=False)
    values = residuals.values
    good = np.ones(len(values), dtype=bool)
    rows = relations.residuals
    command, circuit = rows.channel(COMMAND), rows.column(rows.circuit)
    corroborated = command >= 0 and np.isfinite(run.rows[:, command]).any()
    if circuit >= 0 and not corroborated:
        good = usable(values[:, circuit], identified.voltage_limit_v)
        _leave_out(values, good, rows)
    return Trace(
        run.name,
        rows,
        values,
        np.abs(residuals.speed_m_s),
        residuals.moving,
        good,
    )


def _leave_out(values: Array, good: npt.NDArray[np.bool_], rows: ResidualSet) -> None:
    """Drop what needs the voltage where that is not good."""
    for column in rows.needing(VOLTAGE):
        values[~good, column] = np.nan


def with_innovations(traced: Trace, innovations: Array) -> Trace:
    """The same trace with the observer's residuals added, shape (scans, innovations)."""
    values = traced.values.copy()
    values[:, traced.rows.innovation_columns] = innovations
    _leave_out(values, traced.voltage_usable, traced.rows)
    return replace(traced, values=values)


def stretches(traced: Trace, period_s: float) -> list[BadStretch]:
    """Intervals of bad voltage of one recording, in seconds from its start."""
    bad = np.flatnonzero(np.diff(np.concatenate(([False], ~traced.voltage_usable, [False]))))
    return [
        BadStretch(traced.name, VOLTAGE, float(a * period_s), float(b * period_s))
        for a, b in bad.reshape(-1, 2)
        if b - a >= ENTER_SAMPLES
    ]


def limits(
    traces: Sequence[Trace],
    false_alarms_per_hour: float,
    period_s: float,
    spread: Mapping[str, tuple[float, ...]] = MappingProxyType({}),
) -> tuple[ResidualLimit, ...]:
    """Limits of every residual that the recordings can form.

    ``spread`` holds d r / d theta of healthy units for residuals without an analytical one.
    """
    if not traces:
        return ()
    found, rows = [], traces[0].rows.rows
    tests = sum(row.gate != "sensor" for row in rows)
    rate = (1.0 - SENSOR_SHARE - SHIFT_SHARE) * false_alarms_per_hour / tests
    for index, row in enumerate(rows):
        if row.gate == "sensor":
            continue
        columns = [_gated(row, index, entry) for entry in traces]
        columns = [(values, speed) for values, speed in columns if len(values) >= row.windows[0]]
        if len(columns) < 2:
            continue
        limit = _limit(row, columns, rate, period_s)
        if limit is not None:
            found.append(replace(limit, spread=spread.get(row.name, ())))
    return tuple(found)


def shift_limits(
    traces: Sequence[Trace], false_alarms_per_hour: float, period_s: float
) -> tuple[MeanShiftLimit, ...]:
    """Limits of the mean shift within a recording, for each residual with unit variability.

    They share ``SHIFT_SHARE`` of the false-alarm rate.
    """
    rows = traces[0].rows
    rate = SHIFT_SHARE * false_alarms_per_hour / (max(len(rows.spreading), 1) * len(SHIFT_WINDOWS))
    pieces = sum(len(entry.values) for entry in traces) * period_s / PIECE_S
    found = []
    for column in rows.spreading:
        name = rows.rows[column].name
        shifts = [_shifts(rows.rows[column], column, entry) for entry in traces]
        for index, window in enumerate(SHIFT_WINDOWS):
            k = _student(rate * window * period_s / 3600.0, max(pieces - 1.0, 2.0))
            found.append(limit_of(name, window, [each[:, index] for each in shifts], k, GUARD))
    return tuple(limit for limit in found if limit is not None)


def _shifts(row: ResidualRow, column: int, entry: Trace) -> Array:
    gated = row.gate == "moving"
    use = entry.moving[:, None] | (not gated)
    return MeanShift([gated]).step(entry.values[:, [column], None], use)[:, 0, :, 0]


def _gated(row: ResidualRow, index: int, entry: Trace) -> tuple[Array, Array]:
    values = entry.values[:, index]
    use = np.isfinite(values)
    if row.gate == "moving":
        use &= entry.moving
    return values[use], np.nan_to_num(entry.speed_m_s[use])


def _limit(
    row: ResidualRow, columns: list[tuple[Array, Array]], rate_per_hour: float, period_s: float
) -> ResidualLimit | None:
    everything = np.concatenate([values for values, _ in columns])
    if not np.any(everything):
        return None
    pieces = len(everything) * period_s / PIECE_S
    windows = []
    for window in row.windows:
        means = [
            (_rolling(values, window), _rolling(speed, window))
            for values, speed in columns
            if len(values) >= window
        ]
        if len(means) >= 2:
            windows.append(_window_limit(window, means, rate_per_hour, pieces, period_s))
    scatter = float(everything.std())
    if not windows or not scatter > 0.0:
        return None
    return ResidualLimit(
        row.name,
        tuple(windows),
        (scatter,) * REGIONS,
        _correlation(windows, scatter),
    )


def _rolling(values: Array, window: int) -> Array:
    sums = np.concatenate(([0.0], np.cumsum(values)))
    rolled: Array = (sums[window:] - sums[:-window]) / window
    return rolled


def _correlation(windows: Sequence[WindowLimit], scatter: float) -> float:
    """Samples per independent sample: w var(mean) / var(sample), largest over all windows."""
    worst = max(limit.window * float(np.mean(limit.sigma)) ** 2 for limit in windows)
    return max(1.0, worst / scatter**2)


def _window_limit(
    window: int,
    means: list[tuple[Array, Array]],
    rate_per_hour: float,
    pieces: float,
    period_s: float,
) -> WindowLimit:
    statistic = [mean for mean, _ in means]
    regions = [np.searchsorted(SPEED_REGIONS_M_S, speed) for _, speed in means]
    pooled = _moments(statistic)
    centre, sigma = [], []
    for region in range(REGIONS):
        parts = [m[r == region] for m, r in zip(statistic, regions, strict=True)]
        parts = [part for part in parts if len(part)]
        # Too few recordings in a region do not determine its scatter.
        moments = _moments(parts) if len(parts) >= 5 else pooled
        centre.append(moments[0])
        sigma.append(max(moments[1], 0.5 * pooled[1]))
    z = np.concatenate(
        [
            np.abs(m - np.take(centre, r)) / np.take(sigma, r)
            for m, r in zip(statistic, regions, strict=True)
        ]
    )
    alpha = rate_per_hour * window * period_s / 3600.0
    k = max(_student(alpha, max(pieces - 1.0, 2.0)), GUARD * float(z.max()))
    return WindowLimit(window, tuple(centre), tuple(sigma), k)


def _moments(parts: list[Array]) -> tuple[float, float]:
    """Centre and scatter, with equal weight for every recording."""
    centre = float(np.mean([part.mean() for part in parts]))
    scatter = float(np.mean([np.mean((part - centre) ** 2) for part in parts])) ** 0.5
    return centre, max(scatter, 1e-9)


def _student(alpha: float, degrees: float) -> float:
    from scipy.special import stdtrit

    return float(-stdtrit(degrees, min(alpha, 0.5) / 2.0))
