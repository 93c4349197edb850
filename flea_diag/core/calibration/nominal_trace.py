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

"""Residuals of one nominal recording, as limits are learned from them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
import numpy.typing as npt

from flea_diag.core.calibration.calibration import BadStretch, NominalRun
from flea_diag.core.calibration.identified import Identified
from flea_diag.core.detection.coefficient_shift import CoefficientShift
from flea_diag.core.detection.coefficient_tests import coefficient_rows
from flea_diag.core.flag_runs import flag_runs
from flea_diag.core.likelihood.run_parameters import free_terms, own_values
from flea_diag.core.residuals.relation_set import RelationSet
from flea_diag.core.residuals.residual_bank import ResidualBank
from flea_diag.core.residuals.residual_rows import ReadingTerm, ResidualSet
from flea_diag.core.scan_counts import ScanCounts
from flea_diag.core.sensors.plausibility import ENTER_S, usable

ROUNDING = 1e-16
"""Share of the squares of a residual that is no noise."""
Array = npt.NDArray[np.float64]
Flags = npt.NDArray[np.bool_]


@dataclass(frozen=True)
class Trace:
    """Residuals of one nominal recording; values shape (scans, residuals), order of ``rows``.

    ``spread``, shape (scans, ``ResidualSet.spreading``, unit parameters): d r / d theta of healthy
    units; None where not known.
    """

    name: str
    rows: ResidualSet
    values: Array
    speed_m_s: Array
    moving: Flags
    voltage_usable: Flags
    spread: Array | None = None
    signals: Array = field(default_factory=lambda: np.empty((0, 0)))
    """Signals of the relations, smoothed, shape (scans, signals)."""
    position: Array = field(default_factory=lambda: np.empty(0))
    position_channel: str = ""
    temperatures: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    """Smallest and largest reading of each channel of a temperature."""
    loads: Array = field(default_factory=lambda: np.empty((0, 0)))
    """In the metric of the recordings, shape (scans, loads); without scans where not known."""
    supplied: Array | None = None
    """What heats each predicted store, as ``OperatingPlace.supplied``."""


def trace(
    run: NominalRun,
    identified: Identified,
    relations: RelationSet,
    period_s: float,
) -> Trace:
    """Run one recording through the residual bank, without intervals of bad voltage."""
    counts = ScanCounts(period_s, relations.residuals.smoothing_s)
    bank = ResidualBank(identified.parameters, relations, period_s=period_s, counts=counts)
    residuals = bank.step(run.rows, frozen=False)
    terms = free_terms(relations)
    if terms is not None:
        # What a diagnosis estimates in each run is no scatter between recordings.
        own = own_values(terms, identified.parameters, residuals)
        parameters = replace(identified.parameters, **own)
        bank = ResidualBank(parameters, relations, period_s=period_s, counts=counts)
        residuals = bank.step(run.rows, frozen=False)
    values, rows = residuals.values, relations.residuals
    good = voltage_usable(run.rows, values, identified.voltage_limit_v, rows, counts)
    _leave_out(values, good, rows)
    channel, position = displacement(rows, run.rows)
    return Trace(
        run.name,
        rows,
        values,
        np.abs(residuals.speed_m_s),
        residuals.moving,
        good,
        residuals.spread,
        residuals.signals,
        position,
        channel,
        {name: _range(run.rows[:, rows.index[name]]) for name in rows.predicted},
    )


def voltage_usable(
    readings: Array, values: Array, limit_v: float, rows: ResidualSet, counts: ScanCounts
) -> Flags:
    """Scans in which the voltage is plausible by its own balance, or a command corroborates it."""
    command, circuit = rows.channel(rows.command), rows.column(rows.circuit)
    corroborated = command >= 0 and np.isfinite(readings[:, command]).any()
    if circuit < 0 or corroborated:
        return np.ones(len(values), dtype=bool)
    return usable(values[:, circuit], limit_v, counts)


def _range(readings: Array) -> tuple[float, float]:
    """Smallest and largest; NaN where none is there."""
    known = readings[np.isfinite(readings)]
    return (float(known.min()), float(known.max())) if len(known) else (np.nan, np.nan)


def displacement(rows: ResidualSet, readings: Array) -> tuple[str, Array]:
    """The first channel of a displacement that is there, and its readings; 0 without one."""
    for channel in rows.positions:
        column = readings[:, rows.index[channel]]
        if np.isfinite(column).any():
            return channel, column
    return "", np.zeros(len(readings))


def _leave_out(values: Array, good: Flags, rows: ResidualSet) -> None:
    """Drop what needs the voltage where that is not good."""
    for column in rows.needing(rows.voltage):
        values[~good, column] = np.nan


def with_innovations(traced: Trace, innovations: Array) -> Trace:
    """The same trace with the observer's residuals added, shape (scans, innovations)."""
    values = traced.values.copy()
    values[:, traced.rows.innovation_columns] = innovations
    _leave_out(values, traced.voltage_usable, traced.rows)
    return replace(traced, values=values)


def stretches(traced: Trace, period_s: float) -> list[BadStretch]:
    """Intervals of bad voltage of one recording, in seconds from its start."""
    return [
        BadStretch(traced.name, traced.rows.voltage, float(a * period_s), float(b * period_s))
        for a, b in flag_runs(~traced.voltage_usable)
        if b - a >= ScanCounts(period_s).of(ENTER_S)
    ]


def own_noise(
    traces: Sequence[Trace], term: ReadingTerm, tolerance: Array, between: float
) -> float:
    """Noise of a sample of a residual: what its unit's own parameters leave of each recording.

    0 where they leave nothing but rounding.
    """
    left, whole, count = 0.0, 0.0, 0
    for trace in traces:
        rows, use = _coefficient_rows(trace, [term], tolerance, between)
        psi, residual = rows[use, :-2], rows[use, -2]
        if len(psi) > psi.shape[1]:
            found = np.linalg.lstsq(psi, residual, rcond=None)[0]
            left += float(np.square(residual - psi @ found).sum())
            whole += float(np.square(residual).sum())
            count += len(residual) - psi.shape[1]
    return float(np.sqrt(left / count)) if left > ROUNDING * whole else 0.0


def coefficient_shifts(
    trace: Trace,
    terms: Sequence[ReadingTerm],
    tolerance: Array,
    between: float,
    sigma: float,
    counts: ScanCounts,
) -> Array:
    """Z of the coefficients of one residual after each bin, shape (n, readings, windows)."""
    rows, use = _coefficient_rows(trace, terms, tolerance, between)
    own = rows.shape[1] - len(terms) - 1
    shift = CoefficientShift(own, len(terms), sigma, counts=counts)
    return shift.step(rows, use)[:, 0]


def _coefficient_rows(
    trace: Trace, terms: Sequence[ReadingTerm], tolerance: Array, between: float
) -> tuple[Array, Flags]:
    """``coefficient_rows`` of a recording, and which scans count.

    ``between`` is the variance of the residual between recordings.
    """
    known, first = trace.rows, terms[0]
    column = known.place[first.residual]
    spread = np.zeros((len(trace.values), len(tolerance)))
    if trace.spread is not None:
        spread = trace.spread[:, known.spreading.index(column), list(first.units)]
    loads = trace.loads * np.sqrt(between)
    loads = loads if len(loads) else np.empty((len(spread), 0))
    rows = coefficient_rows(
        terms, spread * tolerance, loads, trace.supplied, trace.values[:, column], trace.signals
    )
    return rows, trace.moving & np.isfinite(rows).all(axis=1)
