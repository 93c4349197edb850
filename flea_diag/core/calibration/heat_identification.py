"""Heating and cooling of motor and nut, from one temperature slope per recording.

    dT/dt = h q - (T - Ta) / tau          q: (i - i0)^2 averaged, or the mean friction power

Thermocouple noise masks changes within a run, so each run is one row. The covariance follows
from the scatter of the rows, each with its own error scale (White 1980).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Protocol

import numpy as np
import numpy.typing as npt

from flea_diag.core.calibration.calibration import NominalRun
from flea_diag.core.residuals.parameters import ActuatorParameters
from flea_diag.core.residuals.residual_rows import INDEX

Array = npt.NDArray[np.float64]
Source = Callable[[Array, ActuatorParameters, float], float]
"""Heat source of a node, as its mean over one recording."""

LEAST_RUNS = 4
LEAST_COOLING_PER_S = 1e-5


class Result(Protocol):
    """Receives the identified parameters and those that cannot be identified."""

    parameters: ActuatorParameters

    def found(self, values: dict[str, float], covariance: Array) -> None:
        """Parameters that the data identify."""
        ...

    def missing(self, names: Sequence[str], reason: str) -> None:
        """Parameters that keep their defaults."""
        ...


def identify(runs: Sequence[NominalRun], period_s: float, result: Result) -> None:
    """Identify heating and cooling of both nodes as far as the recordings allow."""
    _heat(runs, period_s, "motor_temperature", result, _copper_square)
    _heat(runs, period_s, "nut_temperature", result, _friction_power)


def _copper_square(rows: Array, p: ActuatorParameters, period_s: float) -> float:
    # Averaged first, as in the residual bank: PWM ripple heats too, but equally in both places.
    current = np.convolve(rows[:, INDEX["motor_current"]], np.full(15, 1 / 15), mode="valid")
    return float(np.nanmean((current - p.current_offset_a) ** 2))


def _friction_power(rows: Array, p: ActuatorParameters, period_s: float) -> float:
    travel = np.nansum(np.abs(np.diff(rows[::10, INDEX["actuator_position"]])))
    return float(p.coulomb_friction_n * travel / (len(rows) * period_s))


_HEAT_NAMES = {
    "motor_temperature": ("motor_heating_k_per_a2s", "motor_cooling_s"),
    "nut_temperature": ("nut_heating_k_per_j", "nut_cooling_s"),
}


def _heat(
    runs: Sequence[NominalRun], period_s: float, channel: str, result: Result, source: Source
) -> None:
    names = _HEAT_NAMES[channel]
    table = [_slope(run.rows, channel, period_s, result.parameters, source) for run in runs]
    rows = np.array([row for row in table if row is not None])
    if len(rows) < LEAST_RUNS:
        words = f"{len(rows)} recordings with {channel} and ambient, {LEAST_RUNS} are needed"
        result.missing(names, words)
        return
    slope, heat, excess = rows.T
    x, covariance = _fitted(np.stack((heat, -excess), axis=1), slope)
    if x[1] > LEAST_COOLING_PER_S and x[0] >= 0.0:
        tau = 1.0 / float(x[1])
        gradient = np.diag([1.0, -tau * tau])
        values = {names[0]: float(x[0]), names[1]: tau}
        result.found(values, gradient @ covariance @ gradient.T)
        return
    result.missing(names[1:], "no cooling within the recordings")
    cooled = slope + excess / getattr(result.parameters, names[1])
    x, covariance = _fitted(heat[:, None], cooled)
    result.found({names[0]: max(float(x[0]), 0.0)}, covariance)


def _fitted(A: Array, y: Array) -> tuple[Array, Array]:
    """Least squares, and its covariance from the row residuals, corrected by n / (n - k)."""
    x = np.asarray(np.linalg.lstsq(A, y, rcond=None)[0], dtype=np.float64)
    bread = np.linalg.pinv(A.T @ A)
    scores = A * (y - A @ x)[:, None]
    few = len(y) / max(len(y) - A.shape[1], 1)
    covariance: Array = few * bread @ (scores.T @ scores) @ bread
    return x, covariance


def _slope(
    rows: Array,
    channel: str,
    period_s: float,
    p: ActuatorParameters,
    source: Source,
) -> tuple[float, float, float] | None:
    measured, ambient = rows[:, INDEX[channel]], rows[:, INDEX["ambient_temperature"]]
    middle = np.nanmedian(measured) if np.isfinite(measured).any() else np.nan
    # Single-sample spikes of 10 K and more would bias an ordinary slope.
    use = np.isfinite(measured) & (np.abs(measured - middle) < 4.0)
    if use.sum() < 500 or not np.isfinite(ambient).any():
        return None
    time_s = np.arange(len(rows)) * period_s
    slope = float(np.polyfit(time_s[use], measured[use], 1)[0])
    return slope, source(rows, p, period_s), float(middle - np.nanmedian(ambient))
