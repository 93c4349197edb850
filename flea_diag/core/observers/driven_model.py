"""The actuator in linear coordinates, driven by measured voltage and load.

The state equations of the bond graph's "driven" model (Narasimhan et al. 2010, section 4.1),
at the nut and with the parameters that a calibration identifies; L / R is far below a scan,
so the current follows at once:

    i   = i0 + (V - V0 - Ke v) / R(T)
    M v' = K (i - i0) - (fc + c|F|) s(v) - B v - F           s(v) = tanh(v / v_s)
    x'  = v

The linear part is exact for inputs held over a scan, friction takes the two-stage
exponential rule of ``discretisation``. Current and encoder speed are means over a scan where
the DAQ averages, so the mean speed of the scan is a state of its own.

Where the voltage is raw PWM (one instant of +24, 0 or -24 V), a sample says little of the
mean voltage, which is what moves the motor. It is then no input but a very noisy measurement
of a slowly wandering mean, and the current says the rest.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import numpy.typing as npt

from flea_diag.core import backend as backends
from flea_diag.core.frozen import Frozen
from flea_diag.core.observers.observer_model import difference_jacobian
from flea_diag.core.observers.observer_noise import ObserverNoise
from flea_diag.core.observers.track_loops import TRANSITION
from flea_diag.core.residuals.parameters import ActuatorParameters
from flea_diag.core.residuals.residual import COPPER_PER_K

Array = npt.NDArray[np.float64]

STATES = (
    "voltage_v",
    "mean_speed_m_s",
    "speed_m_s",
    "position_m",
)
CHANNELS = (
    "motor_current",
    "motor_voltage",
    "motor_speed",
    "actuator_position",
    "load_position",
)
INPUTS = ("motor_voltage", "load_force")


POSITION_WALK_M = 1.0e-6
"""Keeps a perfect integral of the speed from shutting out the position sensor."""


@dataclass(frozen=True)
class DrivenModel(Frozen):
    """A ``FilterModel`` of an actuator with calibrated parameters."""

    parameters: ActuatorParameters
    period_s: float
    noise: ObserverNoise
    pwm: bool
    """Voltage sampled as raw PWM, hence a measurement and no input."""
    backend: str = "numpy"
    winding_rise_k: float = 0.0
    """Winding temperature above the one that the resistance holds at."""

    states = STATES
    channels = CHANNELS
    inputs = INPUTS
    linear = None

    @property
    def resistance_ohm(self) -> float:
        """Of the winding as warm as it is."""
        rise = 1.0 + COPPER_PER_K * self.winding_rise_k
        return self.parameters.winding_resistance_ohm * rise

    def warmed(self, rise_k: float) -> DrivenModel:
        """The same with another winding temperature."""
        return replace(self, winding_rise_k=rise_k)

    @cached_property
    def driving(self) -> npt.NDArray[np.bool_]:
        """Raw PWM stands for the input that is missing."""
        return np.array([name == "motor_voltage" and self.pwm for name in CHANNELS])

    @cached_property
    def H(self) -> Array:
        """Shape (5, 4); the encoder's row is zero without an encoder."""
        p, R = self.parameters, self.resistance_ohm
        rows = np.zeros((len(CHANNELS), len(STATES)))
        rows[0, :2] = 1.0 / R, -p.back_emf_v_s_per_m / R
        rows[1, 0] = 1.0
        rows[2, 1] = 1.0 / p.encoder_m_per_rad if p.encoder_m_per_rad else 0.0
        rows[3, 3] = rows[4, 3] = 1.0
        return rows

    @cached_property
    def D(self) -> Array:
        """Inputs act through the states alone."""
        return np.zeros((len(CHANNELS), len(INPUTS)))

    @cached_property
    def h(self) -> Array:
        """Offsets of the readings, shape (5,)."""
        p = self.parameters
        current = p.current_offset_a - p.voltage_offset_v / self.resistance_ohm
        return np.array([current, 0.0, 0.0, 0.0, -p.position_offset_m])

    @cached_property
    def R(self) -> Array:
        """Diagonal, shape (5, 5)."""
        return np.diag(self.noise.readings() ** 2)

    @cached_property
    def constants(self) -> Array:
        """In the order in which both transitions unpack them, shape (14,)."""
        p, T, R = self.parameters, self.period_s, self.resistance_ohm
        damping = p.force_constant_n_per_a * p.back_emf_v_s_per_m / R
        damping += p.viscous_friction_n_s_per_m
        decay = math.exp(-damping * T / p.reflected_mass_kg)
        mean = (1.0 - decay) * p.reflected_mass_kg / (damping * T)
        return np.array(
            [
                T,
                decay,
                (1.0 - decay) / damping,  # speed gained in a scan per newton
                mean,
                (1.0 - mean) / damping,  # mean speed gained per newton
                p.force_constant_n_per_a / R,
                p.voltage_offset_v,
                p.back_emf_v_s_per_m / R,
                p.force_constant_n_per_a,
                p.coulomb_friction_n,
                p.load_friction_ratio,
                p.viscous_friction_n_s_per_m,
                1.0 / p.stribeck_speed_m_s,
                1.0 / R,
            ]
        )

    @cached_property
    def _noises(self) -> dict[tuple[bool, bool], Array]:
        """Process noise by whether voltage and load are measured."""
        T, _, gained, _, averaged, force_per_volt, *_ = self.constants
        noise = self.noise
        per_newton = np.array([0.0, averaged, gained, T * averaged])
        per_volt = force_per_volt * per_newton
        per_volt[0] = 1.0
        own = np.diag([0.0, 0.0, 0.0, POSITION_WALK_M]) ** 2
        found = {}
        for voltage in (False, True):
            for load in (False, True):
                volt = noise.voltage_v if voltage else noise.voltage_walk_v
                newton = math.hypot(noise.force_n, 0.0 if load else noise.unmeasured_force_n)
                found[voltage, load] = (
                    own
                    + volt**2 * np.outer(per_volt, per_volt)
                    + newton**2 * np.outer(per_newton, per_newton)
                )
        return found

    def process_noise(self, u: Array) -> Array:
        """By which of voltage and load are measured."""
        return self._noises[not (self.pwm or math.isnan(u[0])), not math.isnan(u[1])]

    @cached_property
    def _move(self) -> Callable[..., None]:
        numba = self.backend == "numba"
        return backends.compiled(*TRANSITION) if numba else transition_numpy

    def transition(self, x: Array, u: Array) -> Array:
        """(4, N) and (2,) -> (4, N); NaN inputs: voltage held, load in balance."""
        new = np.empty_like(x)
        self._move(x, u, self.pwm, self.constants, new)
        return new

    def jacobian(self, x: Array, u: Array) -> Array:
        """By central differences, (4, 4)."""
        return difference_jacobian(self.transition, x, u)


def transition_numpy(x: Array, u: Array, pwm: bool, constants: Array, new: Array) -> None:
    """One scan of all particles, (4, N) -> (4, N) into ``new``."""
    (
        T, decay, gained, kept, averaged, force_per_volt, V0, drag, K,
        coulomb, ratio, viscous, sharp, conductance,
    ) = constants  # fmt: skip
    voltage, mean_speed, speed, position = x
    V, load = u
    current = conductance * (voltage - V0) - drag * mean_speed
    if not (pwm or math.isnan(V)):
        voltage = np.full_like(voltage, V)
    if math.isnan(load):
        friction = coulomb * np.tanh(sharp * speed)
        load = K * current - friction - viscous * speed
    drive = force_per_volt * (voltage - V0) - load
    coulomb = coulomb + ratio * np.abs(load)
    first = drive - coulomb * np.tanh(sharp * speed)
    half = decay * speed + gained * first
    second = drive - coulomb * np.tanh(sharp * half) - first
    new[0] = voltage
    new[1] = kept * speed + averaged * (first + 0.5 * second)
    new[2] = half + averaged * second
    new[3] = position + T * new[1]
