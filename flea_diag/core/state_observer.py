"""Scans in, predictions out: a filter on the driven model, ready for the observer stage.

    r = y - ŷ(k | k-1)        for every measured channel (Narasimhan et al. 2010, section 3.1)

A filter that corrects itself smears a faulty sensor into its states, so once a fault has been
detected it is to be called with ``frozen``; what isolates faults are parity relations, which
need no state.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import numpy.typing as npt

from flea_diag.core import backend as backends
from flea_diag.core.driven_model import CHANNELS as MOVED
from flea_diag.core.driven_model import STATES, DrivenModel
from flea_diag.core.kalman import KalmanFilter
from flea_diag.core.observer_noise import ObserverNoise
from flea_diag.core.parameters import ActuatorParameters
from flea_diag.core.particle_filter import ParticleFilter
from flea_diag.core.residual_bank import INDEX
from flea_diag.core.state_filter import Filter, Innovation
from flea_diag.core.thermal_filter import ThermalFilter
from flea_diag.errors import ConfigurationError

Array = npt.NDArray[np.float64]

PREDICTED = (*MOVED, "motor_temperature", "nut_temperature")
"""Channels that the observer predicts, in the order of its innovations."""
FILTERS = ("optimal", "bootstrap", "kalman")
SAMPLINGS = ("mean", "instant_pwm")
START_SIGMA = {"voltage_v": 10.0, "mean_speed_m_s": 0.1, "speed_m_s": 0.1, "position_m": 0.001}
"""What is known of the states before the first scan, beside its own readings."""
UNKNOWN_POSITION_M = 0.1
ABSURD = 1.0e6
"""No channel of a test stand reads so much in SI units: not a measurement."""
WARMED_K = 0.5
"""Change of the winding's temperature at which its resistance is renewed."""

_MOVED = np.array([INDEX[name] for name in MOVED])
_VOLTAGE, _COMMAND, _LOAD, _AMBIENT, _MOTOR, _NUT = (
    INDEX[name]
    for name in (
        "motor_voltage",
        "commanded_voltage",
        "load_force",
        "ambient_temperature",
        "motor_temperature",
        "nut_temperature",
    )
)


class StateObserver:
    """Tracks one actuator through the channels of its scans, constant memory.

    Parameters
    ----------
    parameters
        Calibrated.
    period_s
        Between scans.
    generator
        Source of randomness, of 64 bits; unused by the Kalman filter. The same seed, rows
        and backend give the same numbers.
    particles
        How many; unused by the Kalman filter.
    backend
        "numpy", "numba" or "auto".
    noise
        Noise levels, see ``noise_identification.fitted``.
    voltage_sampling
        "mean" or "instant_pwm", as the ChannelTable and the calibration say.
    kind
        "optimal", "bootstrap" (particle filters) or "kalman" (extended Kalman filter).

    Attributes
    ----------
    channels
        Names of what is predicted, the order of every ``Innovation``.

    Raises
    ------
    ConfigurationError
        A parameter out of its limits, by name.
    """

    channels = PREDICTED

    def __init__(
        self,
        parameters: ActuatorParameters,
        period_s: float,
        generator: np.random.Generator,
        particles: int = 200,
        backend: str = "auto",
        *,
        noise: ObserverNoise | None = None,
        voltage_sampling: str = "mean",
        kind: str = "optimal",
    ) -> None:
        if kind not in FILTERS:
            raise ConfigurationError(f"filter {kind!r} is unknown, known are {', '.join(FILTERS)}")
        if voltage_sampling not in SAMPLINGS:
            raise ConfigurationError(
                f"voltage sampling {voltage_sampling!r} is unknown, known are "
                f"{', '.join(SAMPLINGS)}"
            )
        if not period_s > 0.0:
            raise ConfigurationError(f"period_s = {period_s}: must be above 0 s")
        noise = ObserverNoise() if noise is None else noise
        p = parameters
        self._motor = ThermalFilter(
            p.motor_cooling_s, period_s, noise.temperature_walk_k, noise.motor_temperature_k
        )
        self._nut = ThermalFilter(
            p.nut_cooling_s, period_s, noise.temperature_walk_k, noise.nut_temperature_k
        )
        self._generator = generator
        self._particles = particles
        self._kind = kind
        self.backend = "numpy" if kind == "kalman" else backends.chosen(backend)
        self._model = DrivenModel(
            parameters,
            period_s,
            noise,
            voltage_sampling == "instant_pwm",
            self.backend,
        )
        self._u = np.empty(2)
        self._filter: Filter | None = None
        self._adopted()

    def _adopted(self) -> None:
        """What follows from the model's parameters."""
        p = self._model.parameters
        self._encoder = p.encoder_m_per_rad != 0.0
        self._drag = p.back_emf_v_s_per_m
        self._rubbing = p.nut_heating_k_per_j * p.coulomb_friction_n
        self._conductance = 1.0 / self._model.resistance_ohm

    @property
    def mean(self) -> Array:
        """Estimated states of motion, ``driven_model.STATES``; NaN before the first scan."""
        return np.full(len(STATES), math.nan) if self._filter is None else self._filter.mean

    def step(self, row: Array, frozen: bool = False) -> Innovation:
        """Take one scan.

        Parameters
        ----------
        row : shape (channels,)
            Order of ``residual_bank.CHANNELS``, NaN = not measured.
        frozen : bool
            Compare, but correct nothing.
        """
        row = np.where(np.abs(row) < ABSURD, row, math.nan)
        y = row[_MOVED]
        if not self._model.pwm:
            y[1] = math.nan  # an input
        if not self._encoder:
            y[2] = math.nan
        if self._filter is None:
            self._filter = self._started(y, row)
        else:
            self._filter.predict(self._inputs(row))
        moved = self._filter.update(y, frozen=frozen)
        if not frozen and not math.isfinite(moved.nis):
            # Nothing of what was predicted fits in any way: begin again with the next scan.
            self.interrupt()
        return self._with_temperatures(moved, row, frozen)

    def adopt(self, parameters: ActuatorParameters) -> None:
        """Go on with other parameters (the offsets of this unit, once they are learned)."""
        self._renew(replace(self._model, parameters=parameters))

    def interrupt(self) -> None:
        """A gap in the stream: start anew with the next scan, but keep the temperatures."""
        self._filter = None

    def _renew(self, model: DrivenModel) -> None:
        self._model = model
        self._adopted()
        if self._filter is not None:
            self._filter.adopt(model)

    def _inputs(self, row: Array) -> Array:
        p, u = self._model.parameters, self._u
        u[0] = row[_VOLTAGE]
        if math.isnan(u[0]):
            u[0] = p.drive_offset_v + p.drive_gain * row[_COMMAND]
        u[1] = row[_LOAD]
        return u

    def _with_temperatures(self, moved: Innovation, row: Array, frozen: bool) -> Innovation:
        """The innovations of motion and heat in one."""
        p, (voltage, mean_speed, *_) = self._model.parameters, moved.mean.tolist()
        current = self._conductance * (voltage - p.voltage_offset_v - self._drag * mean_speed)
        ambient = float(row[_AMBIENT])
        copper = p.motor_heating_k_per_a2s * current * current
        rubbing = self._rubbing * abs(mean_speed)
        motor = self._motor.step(float(row[_MOTOR]), copper, ambient, frozen)
        nut = self._nut.step(float(row[_NUT]), rubbing, ambient, frozen)
        told = moved.joined((motor, nut), (self._motor.estimate_degc, self._nut.estimate_degc))
        rise = self._motor.estimate_degc - p.reference_temperature_degc
        if abs(rise - self._model.winding_rise_k) > WARMED_K:
            self._renew(replace(self._model, winding_rise_k=rise))
        return told

    def _started(self, y: Array, row: Array) -> Filter:
        """A filter at the first scan, with what its readings say."""
        p = self._model.parameters
        current = float(np.nan_to_num(y[0]))
        position, sigma = y[3], dict(START_SIGMA)
        if math.isnan(position):
            position = y[4] + p.position_offset_m
        if math.isnan(position):
            position, sigma["position_m"] = 0.0, UNKNOWN_POSITION_M
        voltage = p.voltage_offset_v + self._model.resistance_ohm * (current - p.current_offset_a)
        if not self._model.pwm and not math.isnan(row[_VOLTAGE]):
            voltage = row[_VOLTAGE]
        mean = np.array([voltage, 0.0, 0.0, position])
        covariance = np.diag([sigma[name] ** 2 for name in STATES])
        if self._kind == "kalman":
            return KalmanFilter(self._model, mean, covariance)
        return ParticleFilter(
            self._model,
            mean,
            covariance,
            self._generator,
            particles=self._particles,
            proposal=self._kind,
            backend=self.backend,
        )
