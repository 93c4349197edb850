"""Identify the actuator's parameters from nominal recordings, by robust linear regression.

Each relation is linear in its parameters if all signals pass the same smoothing kernel:

    i = i0 + (F + (fc + c|F|) s(v) + B v + M a) / K            (Newton at the nut)
    V = V0 + R (1 + alpha dT) (i - i0) + Ke v                  (Kirchhoff)
    dT/dt = h (i - i0)^2 - (T - Ta) / tau                      (heat, one slope per run)

Standard errors are clustered by recording, because samples within one are far from independent.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
import numpy.typing as npt

from flea_diag.core.calibration import heat_identification
from flea_diag.core.calibration.calibration import CovarianceBlock, NominalRun
from flea_diag.core.residuals.parameters import ActuatorParameters
from flea_diag.core.residuals.residual import COPPER_PER_K
from flea_diag.core.residuals.residual_rows import INDEX
from flea_diag.core.smoothing import hann_kernels
from flea_diag.errors import CalibrationError

Array = npt.NDArray[np.float64]

MOVING_M_S = 0.010
MINIMUM_MOVING_S = 5.0
HUBER = 2.0
"""Residuals beyond this number of robust standard deviations lose weight."""


@dataclass
class Identified:
    """Parameters identified so far, their standard errors, and those not identified."""

    parameters: ActuatorParameters
    sigmas: dict[str, float] = field(default_factory=dict)
    covariance: list[CovarianceBlock] = field(default_factory=list)
    not_identified: dict[str, str] = field(default_factory=dict)
    voltage_limit_v: float = 10.0

    def found(self, values: Mapping[str, float], covariance: Array) -> None:
        """Store identified parameters, fitted together with this covariance."""
        self.parameters = replace(self.parameters, **values)
        sigmas = np.sqrt(np.diag(covariance)).tolist()
        self.sigmas.update(zip(values, sigmas, strict=True))
        rows = tuple(map(tuple, np.asarray(covariance).tolist()))
        self.covariance.append(CovarianceBlock(tuple(values), rows))

    def missing(self, names: Sequence[str], reason: str) -> None:
        """Record parameters that keep their defaults."""
        self.not_identified.update(dict.fromkeys(names, reason))


@dataclass(frozen=True)
class Smoothed:
    """Smoothed columns of all runs, concatenated; ``run`` is the recording of each row."""

    value: Array
    first: Array
    second: Array
    run: npt.NDArray[np.int64]

    def column(self, channel: str) -> Array:
        """Smoothed values of one channel."""
        return self.value[:, INDEX[channel]]


def smooth(runs: Sequence[NominalRun], kernel_length: int, period_s: float) -> Smoothed:
    """All runs, smoothed with the kernel of the diagnoser."""
    kernels = hann_kernels(kernel_length, period_s)
    parts: list[list[Array]] = [[], [], []]
    numbers = []
    for number, run in enumerate(runs):
        if len(run.rows) < kernel_length:
            continue
        windows = np.lib.stride_tricks.sliding_window_view(run.rows, kernel_length, axis=0)
        for part, kernel in zip(parts, kernels, strict=True):
            part.append(windows @ kernel)
        numbers.append(np.full(len(windows), number))
    if not numbers:
        raise CalibrationError("no recording is as long as the smoothing window")
    value, first, second = (np.concatenate(part) for part in parts)
    return Smoothed(value, first, second, np.concatenate(numbers))


def robust_fit(
    A: Array, y: Array, run: npt.NDArray[np.int64], start: Array | None = None
) -> tuple[Array, Array, Array]:
    """Huber regression y = A x: solution, cluster-robust covariance, final weights.

    With ``start`` the first residuals are those of that solution, so that gross errors with
    leverage cannot dominate the fit.
    """
    x = np.linalg.lstsq(A, y, rcond=None)[0] if start is None else start
    weight = np.ones_like(y)
    for _ in range(20):
        residual = y - A @ x
        scale = 1.4826 * np.median(np.abs(residual)) + 1e-12
        weight = 1.0 / np.maximum(1.0, np.abs(residual) / (HUBER * scale))
        # Far outliers have weight 0: they come from a bad channel, not from a long tail.
        weight[np.abs(residual) > 6.0 * scale] = 0.0
        renewed = np.linalg.lstsq(A * weight[:, None], y * weight, rcond=None)[0]
        if np.allclose(renewed, x, rtol=1e-9, atol=1e-12):
            break
        x = renewed
    residual = (y - A @ x) * weight**2
    bread = np.linalg.pinv((A * weight[:, None] ** 2).T @ A)
    scores = np.array([A[run == number].T @ residual[run == number] for number in np.unique(run)])
    covariance: Array = bread @ (scores.T @ scores) @ bread
    return np.asarray(x, dtype=np.float64), covariance, weight


def identify(runs: Sequence[NominalRun], kernel_length: int, period_s: float) -> Identified:
    """Identify every parameter that the recordings allow.

    Raises
    ------
    CalibrationError
        The recordings contain too little motion to identify the actuator.
    """
    data = smooth(runs, kernel_length, period_s)
    result = Identified(ActuatorParameters())
    result.missing(["winding_inductance_h"], "L/R is far below the scan period; an assumption")
    result.missing(["stribeck_speed_m_s"], "width of the smooth sign of friction; an assumption")
    result.missing(["reference_temperature_degc"], "where the resistance holds; a convention")
    _encoder(data, result)
    speed, acceleration = _motion(data, result)
    moving = np.abs(speed) > MOVING_M_S
    moved_s = float(moving.sum()) * period_s
    if moved_s < MINIMUM_MOVING_S:
        raise CalibrationError(
            f"the recordings hold {moved_s:.1f} s of motion above {MOVING_M_S} m/s, "
            f"{MINIMUM_MOVING_S} s are needed: record the actuator while it moves"
        )
    _mechanical(data, speed, acceleration, moving, result)
    _electrical(data, speed, result)
    _drive(data, result)
    _position(data, result)
    heat_identification.identify(runs, period_s, result)
    return result


def _have(data: Smoothed, *channels: str) -> npt.NDArray[np.bool_]:
    finite = np.isfinite(data.value[:, [INDEX[channel] for channel in channels]])
    return np.asarray(finite.all(axis=1), dtype=np.bool_)


def _motion(data: Smoothed, result: Identified) -> tuple[Array, Array]:
    lead = result.parameters.encoder_m_per_rad
    if lead:
        column = INDEX["motor_speed"]
        return lead * data.value[:, column], lead * data.first[:, column]
    column = INDEX["actuator_position"]
    return data.first[:, column], data.second[:, column]


def _encoder(data: Smoothed, result: Identified) -> None:
    use = _have(data, "motor_speed", "actuator_position")
    if not use.any():
        result.missing(["encoder_m_per_rad"], "no motor_speed channel")
        return
    rate = data.first[use, INDEX["actuator_position"]]
    x, covariance, _ = robust_fit(data.column("motor_speed")[use, None], rate, data.run[use])
    result.found({"encoder_m_per_rad": float(x[0])}, covariance)


def _mechanical(
    data: Smoothed,
    speed: Array,
    acceleration: Array,
    moving: npt.NDArray[np.bool_],
    result: Identified,
) -> None:
    use = moving & _have(data, "motor_current", "load_force") & np.isfinite(acceleration)
    names = (
        "coulomb_friction_n",
        "viscous_friction_n_s_per_m",
        "reflected_mass_kg",
        "load_friction_ratio",
    )
    if not use.any():
        result.missing([*names, "force_constant_n_per_a"], "no current, load and motion together")
        return
    load, s = data.column("load_force")[use], np.tanh(speed[use] / 0.004)
    columns = (load, s, speed[use], acceleration[use], np.abs(load) * s, np.ones(use.sum()))
    A = np.stack(columns, axis=1)
    x, covariance, _ = robust_fit(A, data.column("motor_current")[use], data.run[use])
    if x[0] <= 0.0:
        raise CalibrationError(
            f"the current falls by {-x[0]:.2e} A per newton of opposing load: "
            "motor_current or load_force has the wrong sign (positive load opposes extension)"
        )
    K = 1.0 / x[0]
    # Ratios x_k / x_0, and K = 1 / x_0: their covariance by the gradient at the solution.
    gradient = np.zeros((len(x), len(x)))
    gradient[0, 0], gradient[1, 5] = -K * K, 1.0
    values = {"force_constant_n_per_a": K, "current_offset_a": float(x[5])}
    for row, (name, k) in enumerate(zip(names, (1, 2, 3, 4), strict=True), 2):
        gradient[row, k], gradient[row, 0] = K, -x[k] * K * K
        values[name] = max(float(x[k] * K), 0.0)
    result.found(values, gradient @ covariance @ gradient.T)


def _electrical(data: Smoothed, speed: Array, result: Identified) -> None:
    use = _have(data, "motor_voltage", "motor_current") & np.isfinite(speed)
    names = ("winding_resistance_ohm", "back_emf_v_s_per_m", "voltage_offset_v")
    p = result.parameters
    if not use.any():
        result.missing(names, "no motor_voltage channel")
        return
    rise = np.nan_to_num(data.column("motor_temperature") - p.reference_temperature_degc)
    current = (data.column("motor_current") - p.current_offset_a) * (1.0 + COPPER_PER_K * rise)
    voltage = data.column("motor_voltage")[use]
    A = np.stack((current[use], speed[use], np.ones(use.sum())), axis=1)
    # Energy conservation: the back-EMF constant equals the force constant. With R given, only
    # the offset is unknown; a median finds it if fewer than half of the samples are bad.
    start = np.array([p.winding_resistance_ohm, p.force_constant_n_per_a, 0.0])
    start[2] = np.median(voltage - A @ start)
    x, covariance, weight = robust_fit(A, voltage, data.run[use], start)
    residual = voltage - A @ x
    scale = 1.4826 * float(np.median(np.abs(residual[weight > 0])))
    # No healthy unit deviates by a third of the drive's output range.
    supply_v = float(np.quantile(np.abs(voltage), 0.99))
    result.voltage_limit_v = max(8.0 * scale, supply_v / 3.0)
    values = dict(zip(names, map(float, x), strict=True))
    result.found(values, covariance)


def _drive(data: Smoothed, result: Identified) -> None:
    use = _have(data, "motor_voltage", "commanded_voltage")
    if not use.any():
        result.missing(["drive_gain", "drive_offset_v"], "no commanded_voltage channel")
        return
    A = np.stack((data.column("commanded_voltage")[use], np.ones(use.sum())), axis=1)
    x, covariance, _ = robust_fit(A, data.column("motor_voltage")[use], data.run[use])
    result.found(
        dict(zip(("drive_gain", "drive_offset_v"), map(float, x), strict=True)), covariance
    )


def _position(data: Smoothed, result: Identified) -> None:
    use = _have(data, "actuator_position", "load_position")
    if not use.any():
        result.missing(["position_offset_m"], "no second position channel")
        return
    apart = (data.column("actuator_position") - data.column("load_position"))[use]
    offset, run = float(np.median(apart)), data.run[use]
    each = np.array([np.median(apart[run == number]) for number in np.unique(run)])
    error = float(np.var(each, ddof=1)) / len(each) if len(each) > 1 else float(np.var(apart))
    result.found({"position_offset_m": offset}, np.array([[error]]))
