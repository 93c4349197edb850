"""Noise levels of the observer from nominal recordings.

The scatter of single readings follows from their third differences. The other levels (drift of
the mean voltage, unmodelled forces, current ripple, speed difference of shaft and nut from
backlash and lead errors) are fitted by maximum likelihood of the Kalman filter's innovations
(Schweppe 1965). The search multiplies by factors of two, then of the square root of two.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from functools import cache

import numpy as np
import numpy.typing as npt

from flea_diag.core.calibration.calibration import NominalRun
from flea_diag.core.observers.observer_noise import ObserverNoise, reading_key
from flea_diag.core.observers.state_observer import StateObserver
from flea_diag.core.residuals.parameters import ActuatorParameters
from flea_diag.core.residuals.relation_set import RelationSet
from flea_diag.core.residuals.residual_rows import ResidualSet
from flea_diag.core.smoothing import hann_kernels
from flea_diag.errors import CalibrationError

Array = npt.NDArray[np.float64]

FACTORS = (2.0, math.sqrt(2.0))
PIECES = 4  # assumption: size of a sample
PIECE_SCANS = 300  # assumption: size of a sample
SETTLE_SCANS = 50  # assumption
FREEDOM = 8.0
"""Degrees of freedom of Student's t distribution, assumed for the innovations."""


def fitted(
    runs: Sequence[NominalRun],
    parameters: ActuatorParameters,
    relations: RelationSet,
    period_s: float,
    voltage_sampling: str,
) -> ObserverNoise:
    """Noise levels of maximum likelihood on nominal recordings.

    Raises
    ------
    CalibrationError
        No recording is long enough.
    """
    pieces, rows = _pieces(runs), relations.residuals
    noise = _read_off(runs, rows, period_s)
    searched = _searched(rows, voltage_sampling == "mean")

    @cache
    def cost(tried: ObserverNoise) -> float:
        return _cost(pieces, parameters, relations, period_s, voltage_sampling, tried)

    best = cost(noise)
    for factor in FACTORS:
        improved = True
        while improved:
            improved = False
            for name in searched:
                for step in (factor, 1.0 / factor):
                    tried = noise.scaled(name, step)
                    if cost(tried) < best - 1e-3:
                        noise, best, improved = tried, cost(tried), True
                        break
    return noise


def _pieces(runs: Sequence[NominalRun]) -> list[Array]:
    """Pieces from the middle of recordings, chosen evenly over all recordings."""
    usable = [run.rows for run in runs if len(run.rows) >= PIECE_SCANS]
    if not usable:
        raise CalibrationError(
            f"no recording is as long as {PIECE_SCANS} scans: the observer's noise cannot be fitted"
        )
    chosen = usable[:: max(1, len(usable) // PIECES)][:PIECES]
    starts = [(len(rows) - PIECE_SCANS) // 2 for rows in chosen]
    return [rows[at : at + PIECE_SCANS] for rows, at in zip(chosen, starts, strict=True)]


def _searched(rows: ResidualSet, mean: bool) -> tuple[str, ...]:
    """Levels that are fitted: the process, and readings that differ by more than their noise."""
    channels = (rows.current, rows.encoder) if mean else (rows.current,)
    keys = (reading_key(name, rows.units[name]) for name in channels if name in rows.observed)
    return ("voltage_v" if mean else "voltage_walk_v", "force_n", *keys)


def _read_off(runs: Sequence[NominalRun], rows: ResidualSet, period_s: float) -> ObserverNoise:
    readings = []
    for channel in rows.predicted:
        if channel == rows.voltage:
            continue
        columns = [run.rows[:, rows.index[channel]] for run in runs]
        scatter = np.concatenate([np.abs(np.diff(column, 3)) for column in columns])
        scatter = scatter[np.isfinite(scatter)]
        level = rows.noise[channel]
        if len(scatter):
            # Third differences of white noise have 20 times its variance.
            level = max(1.4826 * float(np.median(scatter)) / math.sqrt(20.0), 1e-9)
        readings.append((reading_key(channel, rows.units[channel]), level))
    noise = ObserverNoise(readings=tuple(readings))
    kernel = hann_kernels(31, period_s)[0]
    apart = [
        column[15:-15] - np.convolve(column, kernel, mode="valid")
        for column in (run.rows[:, rows.index[rows.voltage]] for run in runs)
        if len(column) > 31
    ]
    voltage = np.concatenate(apart) if apart else np.empty(0)
    voltage = voltage[np.isfinite(voltage)]
    if len(voltage):
        noise = replace(noise, voltage_sample_v=max(float(voltage.std()), 1e-3))
    return noise


def _cost(
    pieces: list[Array],
    parameters: ActuatorParameters,
    relations: RelationSet,
    period_s: float,
    voltage_sampling: str,
    noise: ObserverNoise,
) -> float:
    """Twice the negative log likelihood of a scan under Student's t, up to a constant.

    Gross errors have little weight, yet the noise cannot become arbitrarily small as with a
    bounded NIS. Noise levels at which rounding destroys the filter's covariance are refused.
    """
    try:
        with np.errstate(invalid="ignore"):
            return _mean_cost(pieces, parameters, relations, period_s, voltage_sampling, noise)
    except np.linalg.LinAlgError:
        return math.inf


def _mean_cost(
    pieces: list[Array],
    parameters: ActuatorParameters,
    relations: RelationSet,
    period_s: float,
    voltage_sampling: str,
    noise: ObserverNoise,
) -> float:
    total, scans = 0.0, 0
    for rows in pieces:
        observer = StateObserver(
            parameters,
            relations,
            period_s,
            np.random.default_rng(0),
            noise=noise,
            voltage_sampling=voltage_sampling,
            kind="kalman",
        )
        found = observer.follow(rows)
        seen = found.sigmas[SETTLE_SCANS:] > 0.0
        spread = 2.0 * np.log(found.sigmas[SETTLE_SCANS:], where=seen, out=np.zeros(seen.shape))
        tails = FREEDOM + seen.sum(axis=1)
        total += float((tails * np.log1p(found.nis[SETTLE_SCANS:] / FREEDOM)).sum() + spread.sum())
        scans += len(seen)
    return total / scans
