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
from flea_diag.core.observers.driven_model import STATES, DrivenModel
from flea_diag.core.observers.kalman import KalmanFilter
from flea_diag.core.observers.observer_block import (
    HEATED,
    MOTION,
    ORDER,
    PREDICTED,
    RAW,
    SPEED,
    VOLTAGE,
    Innovations,
    Scans,
)
from flea_diag.core.observers.observer_loops import READ, join_loops
from flea_diag.core.observers.observer_noise import ObserverNoise
from flea_diag.core.observers.particle_filter import ParticleFilter
from flea_diag.core.observers.state_filter import Filter, Innovation
from flea_diag.core.observers.thermal_filter import ThermalFilter
from flea_diag.core.observers.track_loops import LOST, WARMED
from flea_diag.core.residuals.parameters import ActuatorParameters
from flea_diag.errors import ConfigurationError, shown

Array = npt.NDArray[np.float64]
Flags = npt.NDArray[np.bool_]

FILTERS = ("optimal", "bootstrap", "kalman")
SAMPLINGS = ("mean", "instant_pwm")
START_SIGMA = {"voltage_v": 10.0, "mean_speed_m_s": 0.1, "speed_m_s": 0.1005, "position_m": 0.001}
"""Prior of the states before the first scan; the last speed of a scan is near its mean speed."""
MEAN, LAST = STATES.index("mean_speed_m_s"), STATES.index("speed_m_s")
UNKNOWN_POSITION_M = 0.1
WARMED_K = 0.5
"""Change of the winding temperature at which the resistance is updated."""


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
            raise ConfigurationError(
                f"filter {shown(kind)} is unknown, known are {', '.join(FILTERS)}"
            )
        if voltage_sampling not in SAMPLINGS:
            raise ConfigurationError(
                f"voltage sampling {shown(voltage_sampling)} is unknown, known are "
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
        self._compiled = self.backend == "numba" and kind == "optimal"
        self._filter: Filter | None = None
        self._adopted()

    def _adopted(self) -> None:
        """What follows from the model's parameters."""
        p, model = self._model.parameters, self._model
        # The mean voltage is an input, and not every stand has an encoder.
        self._absent = np.zeros(len(MOTION), dtype=bool)
        self._absent[VOLTAGE], self._absent[SPEED] = not model.pwm, p.encoder_m_per_rad == 0.0
        self._law = np.array(
            [
                1.0 / model.resistance_ohm,
                p.voltage_offset_v,
                p.back_emf_v_s_per_m,
                p.motor_heating_k_per_a2s,
                p.nut_heating_k_per_j * p.coulomb_friction_n,
                p.reference_temperature_degc + model.winding_rise_k,
                WARMED_K,
            ]
        )

    @property
    def mean(self) -> Array:
        """Estimated states of motion, ``driven_model.STATES``; NaN before the first scan."""
        return np.full(len(STATES), math.nan) if self._filter is None else self._filter.mean

    def step(self, row: Array, frozen: bool = False) -> Innovation:
        """Take one scan, shape (channels,); see ``follow``."""
        return self.follow(row[None], frozen).scan(0)

    def follow(self, rows: Array, frozen: bool = False) -> Innovations:
        """Take n scans, one after another: the same bits for any division into blocks.

        Parameters
        ----------
        rows : shape (n, channels)
            Order of ``residual_rows.CHANNELS``, NaN = not measured.
        frozen : bool
            Compare, but correct nothing.
        """
        scans, measured = self._read(rows)
        raw, lost = np.empty((len(rows), RAW)), np.empty(len(rows), dtype=bool)
        done = 0
        while done < len(rows):
            if self._compiled and isinstance(self._filter, ParticleFilter):
                particles = self._filter
                taken = self._track(particles, scans, done, frozen, raw)
                nis = raw[taken, HEATED - 2].tolist()
                lost[taken] = particles.diverged
                if not frozen:
                    lost[taken] = particles.watch(nis, measured[taken].tolist())
                done = taken.stop
            else:
                self._one(scans, done, frozen, raw[done], lost)
                done += 1
        if not self._compiled:
            return Innovations.joined(raw, measured, lost)
        table = np.empty((len(rows), len(ORDER)))
        backends.exact(join_loops)(raw, measured, table)
        return Innovations(table, measured, lost)

    def _read(self, rows: Array) -> tuple[Scans, npt.NDArray[np.int64]]:
        """Input of the filter, and the number of motion channels measured in each scan."""
        p, driving = self._model.parameters, self._model.driving
        command = p.drive_offset_v, p.drive_gain
        if not self._compiled:
            read = Scans.read(rows, self._absent, command, driving)
            return read, np.isfinite(read.y).sum(axis=1)
        scans, measured = Scans.empty(len(rows)), np.empty(len(rows), dtype=np.int64)
        backends.exact(*READ)(rows, self._absent, command, driving, tuple(scans), measured)
        return scans, measured

    def _track(
        self, particles: ParticleFilter, scans: Scans, first: int, frozen: bool, raw: Array
    ) -> slice:
        """Scans from ``first`` on in one compiled call; which it took."""
        model, nodes = self._model, (self._motor, self._nut)
        state = np.array([node.state() for node in nodes])
        motion = model.pwm, model.constants
        done, end = particles.track(tuple(scans), first, motion, (state, self._law), frozen, raw)
        for node, (estimate_degc, variance, *_) in zip(nodes, state.tolist(), strict=True):
            node.take(estimate_degc, variance)
        self._end(end)
        return slice(first, first + done)

    def _one(self, scans: Scans, k: int, frozen: bool, raw: Array, lost: Flags) -> None:
        """One scan of the loop in Python; ``track_loops`` does the same."""
        y = scans.y[k]
        if self._filter is None:
            # Its readings are where it starts: there is no prediction to hold them against.
            self._filter, y = self._started(y, scans.u[k]), np.full(len(y), math.nan)
        else:
            self._filter.predict(scans.u[k])
        moved = self._filter.update(y, frozen=frozen)
        raw[:HEATED], lost[k] = moved.row, moved.diverged
        conductance, zero, drag, copper, rubbing, cold, warmed = self._law.tolist()
        voltage, speed, *_ = moved.mean.tolist()
        current = conductance * (voltage - zero - drag * speed)
        heats = copper * current * current, rubbing * abs(speed)
        *measured, ambient = scans.degc[k].tolist()
        found = []
        for node, degc, heat in zip((self._motor, self._nut), measured, heats, strict=True):
            found += [*node.step(degc, heat, ambient, frozen), node.estimate_degc]
        raw[HEATED:] = found
        end = 0 if frozen or math.isfinite(moved.nis) else LOST
        self._end(end | (WARMED if abs(self._motor.estimate_degc - cold) > warmed else 0))

    def _end(self, end: int) -> None:
        """Work that the last scan requires before the next one."""
        if end & LOST:
            # The prediction does not fit at all: restart with the next scan.
            self.interrupt()
        if end & WARMED:
            rise = self._motor.estimate_degc - self._model.parameters.reference_temperature_degc
            self._renew(replace(self._model, winding_rise_k=rise))

    def adopt(self, parameters: ActuatorParameters) -> None:
        """Use other parameters (the learned offsets of this unit)."""
        self._renew(replace(self._model, parameters=parameters))

    def interrupt(self) -> None:
        """A gap in the stream: restart with the next scan, but keep the temperatures."""
        self._filter = None

    def _renew(self, model: DrivenModel) -> None:
        self._model = model
        self._adopted()
        if self._filter is not None:
            self._filter.adopt(model)

    def _started(self, y: Array, u: Array) -> Filter:
        """A filter at the first scan: the prior, corrected by the readings of that scan."""
        p, noise = self._model.parameters, self._model.noise
        current = float(np.nan_to_num(y[0]))
        voltage = p.voltage_offset_v + self._model.resistance_ohm * (current - p.current_offset_a)
        position, sigma = y[3], dict(START_SIGMA)
        if math.isnan(position):
            position = y[4] + p.position_offset_m
        if math.isnan(position):
            position, sigma["position_m"] = 0.0, UNKNOWN_POSITION_M
        if not self._model.pwm and not math.isnan(u[0]):
            voltage, sigma["voltage_v"] = u[0], noise.voltage_v
        covariance = np.diag([sigma[name] ** 2 for name in STATES])
        covariance[LAST, MEAN] = covariance[MEAN, LAST] = covariance[MEAN, MEAN]
        # Particles drawn from so wide a prior would all miss the first readings.
        known = KalmanFilter(self._model, np.array([voltage, 0.0, 0.0, position]), covariance)
        known.update(y)
        if self._kind == "kalman":
            return KalmanFilter(self._model, known.mean, known.covariance)
        return ParticleFilter(
            self._model,
            known.mean,
            known.covariance,
            self._generator,
            particles=self._particles,
            proposal=self._kind,
            backend=self.backend,
        )
