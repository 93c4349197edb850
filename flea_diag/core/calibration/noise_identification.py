"""Noise levels of the observer from nominal recordings.

The scatter of single readings follows from their third differences. The other levels (drift of
the mean voltage, unmodelled forces, current ripple, speed difference of shaft and nut from
backlash and lead errors) are fitted by maximum likelihood of the Kalman filter's innovations
(Schweppe 1965). The search multiplies by factors of two, then of the square root of two.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import fields, replace
from functools import cache

import numpy as np
import numpy.typing as npt

from flea_diag.core.calibration.calibration import NominalRun
from flea_diag.core.observers.observer_noise import ObserverNoise
from flea_diag.core.observers.state_observer import StateObserver
from flea_diag.core.residuals.channel_units import VOLTAGE
from flea_diag.core.residuals.parameters import ActuatorParameters
from flea_diag.core.residuals.relation_set import RelationSet
from flea_diag.core.residuals.residual_rows import ResidualSet
from flea_diag.core.smoothing import hann_kernels
from flea_diag.errors import CalibrationError

Array = npt.NDArray[np.float64]

READINGS = {
    "motor_current_a": "motor_current",
    "motor_speed_rad_s": "motor_speed",
    "actuator_position_m": "actuator_position",
    "load_position_m": "load_position",
    "motor_temperature_k": "motor_temperature",
    "nut_temperature_k": "nut_temperature",
}
SEARCHED = {
    "mean": ("voltage_v", "force_n", "motor_current_a", "motor_speed_rad_s"),
    "instant_pwm": ("voltage_walk_v", "force_n", "motor_current_a"),
}
FACTORS = (2.0, math.sqrt(2.0))
PIECES = 4
PIECE_SCANS = 300
SETTLE_SCANS = 50
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
    pieces = _pieces(runs)
    noise = replace(ObserverNoise(), **_read_off(runs, relations.residuals, period_s))

    @cache
    def cost(tried: ObserverNoise) -> float:
        return _cost(pieces, parameters, relations, period_s, voltage_sampling, tried)

    best = cost(noise)
    for factor in FACTORS:
        improved = True
        while improved:
            improved = False
            for name in SEARCHED[voltage_sampling]:
                for step in (factor, 1.0 / factor):
                    tried = replace(noise, **{name: getattr(noise, name) * step})
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


def _read_off(runs: Sequence[NominalRun], rows: ResidualSet, period_s: float) -> dict[str, float]:
    known = {field.name for field in fields(ObserverNoise)}
    found = {}
    for name, channel in READINGS.items():
        if channel not in rows.index:
            continue
        columns = [run.rows[:, rows.index[channel]] for run in runs]
        scatter = np.concatenate([np.abs(np.diff(column, 3)) for column in columns])
        scatter = scatter[np.isfinite(scatter)]
        if len(scatter) and name in known:
            # Third differences of white noise have 20 times its variance.
            found[name] = max(1.4826 * float(np.median(scatter)) / math.sqrt(20.0), 1e-9)
    kernel = hann_kernels(31, period_s)[0]
    apart = [
        column[15:-15] - np.convolve(column, kernel, mode="valid")
        for column in (run.rows[:, rows.index[VOLTAGE]] for run in runs)
        if len(column) > 31
    ]
    voltage = np.concatenate(apart) if apart else np.empty(0)
    voltage = voltage[np.isfinite(voltage)]
    if len(voltage):
        found["voltage_sample_v"] = max(float(voltage.std()), 1e-3)
    return found


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
        for k in range(SETTLE_SCANS, len(rows)):
            told = found.scan(k)
            seen = told.sigma > 0.0
            spread = 2.0 * float(np.log(told.sigma[seen]).sum())
            tails = FREEDOM + np.count_nonzero(seen)
            total += float(tails * np.log1p(told.nis / FREEDOM)) + spread
            scans += 1
    return total / scans
