"""Residuals of one scan or of many, formed on smoothed signals from calibrated parameters.

Relations are written elementwise: signals are numbers for one scan and columns for many, and
the same lines give the same bits for both. Numba compiles them, too (``bank_loops``).

Linear coordinates throughout: forces and speeds at the nut. Of a motor and screw only the
product K * 2 pi / lead can be identified from current, voltage, position and load, so the
calibration holds that product (``force_constant_n_per_a``) and no lead.

Parity relations (analytical redundancy relations of the bond graph's 1-junctions):

electrical  r = V - V0 - R (i - i0) - Ke v
mechanical  r = K (i - i0) - F - (fc + c|F|) s(v) - B v - M a          s(v) = tanh(v / v_s)

Where the actuator stands under a push that moves any healthy one, s is the sign of the push:
it should go that way, and what it lacks is a drag.

Measured voltage and measured load are inputs, so the control loop is cut. Multiplied by the
sign of the speed (``_dn``, direction-normalised) a parameter fault keeps one sign while a
sensor bias alternates; in the raw residual it is the other way round.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from flea_diag.core.residuals.parameters import ActuatorParameters

Value = Any
"""A float, or an array of one for each of many scans: types cannot follow sums of the two."""

COPPER_PER_K = 0.00393
"""Temperature coefficient of resistance of copper near 20 degC."""


class Signals(NamedTuple):
    """Smoothed signals, SI; NaN where a channel is absent or bad.

    Numbers at one instant, or arrays of one shape (n,) over so many scans. ``direction`` is the
    smooth sign of the speed, or of the push where the actuator is stalled.
    """

    current_a: Value
    voltage_v: Value
    commanded_voltage_v: Value
    speed_m_s: Value
    acceleration_m_s2: Value
    load_n: Value
    position_m: Value
    load_position_m: Value
    encoder_speed_rad_s: Value
    position_rate_m_s: Value
    motor_temperature_degc: Value
    nut_temperature_degc: Value
    winding_rise_k: Value
    direction: Value


def direction(parameters: ActuatorParameters, speed_m_s: Value) -> Value:
    """Smooth sign of the speed."""
    # numpy's, also for one number: that of the mathematics library differs in the last bit.
    sign: Value = np.tanh(speed_m_s / parameters.stribeck_speed_m_s)
    # Numbers of numpy's own are ten times slower than Python's in all that follows.
    return float(sign) if isinstance(speed_m_s, float) else sign


STALL = 3.0
"""No healthy screw withstands a push of so many times its dry friction for long. At rest nominal
recordings of the FLEA show 2.6 times for half a second, and 3.5 times for a few scans, which the
means over windows bear."""


def dry_friction_n(p: ActuatorParameters, load_n: Value) -> Value:
    """Size of the nominal friction at the nut that does not grow with the speed."""
    return p.coulomb_friction_n + p.load_friction_ratio * abs(load_n)


def friction_n(p: ActuatorParameters, s: Signals) -> Value:
    """Nominal friction force at the nut."""
    dry = dry_friction_n(p, s.load_n)
    return dry * s.direction + p.viscous_friction_n_s_per_m * s.speed_m_s


def motor_force_n(p: ActuatorParameters, current_a: Value) -> Value:
    """Force of the motor at the nut, by the reading of its current."""
    return p.force_constant_n_per_a * (current_a - p.current_offset_a)


def push_n(
    p: ActuatorParameters, current_a: Value, load_n: Value, acceleration_m_s2: Value
) -> Value:
    """What friction has to withstand: motor force less load and inertia."""
    motor = motor_force_n(p, current_a)
    return motor - load_n - p.reflected_mass_kg * acceleration_m_s2


def mechanical_n(p: ActuatorParameters, s: Signals) -> Value:
    """Newton at the nut: motor force less load, friction and inertia."""
    motor = motor_force_n(p, s.current_a)
    return motor - s.load_n - friction_n(p, s) - p.reflected_mass_kg * s.acceleration_m_s2


def electrical_v(p: ActuatorParameters, s: Signals) -> Value:
    """Kirchhoff in the motor circuit, the resistance at the winding's temperature."""
    resistance = p.winding_resistance_ohm * (1.0 + COPPER_PER_K * s.winding_rise_k)
    drop = resistance * (s.current_a - p.current_offset_a)
    return s.voltage_v - p.voltage_offset_v - drop - p.back_emf_v_s_per_m * s.speed_m_s


def drive_v(p: ActuatorParameters, s: Signals) -> Value:
    """Measured against commanded voltage."""
    return s.voltage_v - p.drive_offset_v - p.drive_gain * s.commanded_voltage_v


def kinematic_m(p: ActuatorParameters, s: Signals) -> Value:
    """The actuator's own position sensor against the potentiometer on the load actuator."""
    return s.position_m - p.position_offset_m - s.load_position_m


def speed_m_s(p: ActuatorParameters, s: Signals) -> Value:
    """Encoder speed through the screw against the slope of the position."""
    return p.encoder_m_per_rad * s.encoder_speed_rad_s - s.position_rate_m_s


@dataclass(frozen=True, slots=True)
class Parity:
    """One row of the residual set.

    ``sensitivity`` gives d r / d theta for each parameter that differs between healthy units
    (``UNIT_PARAMETERS``, same order): by so much a unit's own spread may move the residual.
    None where they do not differ. ``needs`` names the channels without which there is no residual.
    """

    name: str
    unit: str
    needs: tuple[str, ...]
    gated: bool
    normalised: bool
    relation: Callable[[ActuatorParameters, Signals], Value]
    sensitivity: Callable[[ActuatorParameters, Signals], tuple[Value, ...]] | None


UNIT_PARAMETERS = (
    "coulomb_friction_n",
    "viscous_friction_n_s_per_m",
    "reflected_mass_kg",
    "winding_resistance_ohm",
    "back_emf_v_s_per_m",
    "voltage_offset_v",
    "current_offset_a",
)
"""Parameters in which healthy units of one design differ; see ``UnitTolerance``."""


def mechanical_spread(p: ActuatorParameters, s: Signals) -> tuple[Value, ...]:
    """By how much ``mechanical_n`` moves with each of ``UNIT_PARAMETERS``."""
    K = p.force_constant_n_per_a
    return (-s.direction, -s.speed_m_s, -s.acceleration_m_s2, 0.0, 0.0, 0.0, -K)


def electrical_spread(p: ActuatorParameters, s: Signals) -> tuple[Value, ...]:
    """By how much ``electrical_v`` moves with each of ``UNIT_PARAMETERS``."""
    current, R = s.current_a - p.current_offset_a, p.winding_resistance_ohm
    return (0.0, 0.0, 0.0, -current, -s.speed_m_s, -1.0, R)


SPEED = "speed"
"""Stands for the channel the speed comes from: the encoder, or the slope of the position."""
_MECHANICAL = ("motor_current", "load_force", SPEED)
_ELECTRICAL = ("motor_voltage", "motor_current", SPEED)

PARITIES: tuple[Parity, ...] = (
    Parity("parity_mechanical", "N", _MECHANICAL, True, False, mechanical_n, mechanical_spread),
    Parity("parity_mechanical_dn", "N", _MECHANICAL, True, True, mechanical_n, mechanical_spread),
    Parity("parity_electrical", "V", _ELECTRICAL, False, False, electrical_v, electrical_spread),
    Parity("parity_electrical_dn", "V", _ELECTRICAL, True, True, electrical_v, electrical_spread),
    Parity(
        "parity_drive",
        "V",
        ("motor_voltage", "commanded_voltage"),
        False,
        False,
        drive_v,
        None,
    ),
    Parity(
        "parity_kinematic",
        "m",
        ("actuator_position", "load_position"),
        False,
        False,
        kinematic_m,
        None,
    ),
    Parity(
        "parity_speed",
        "m/s",
        ("motor_speed", "actuator_position"),
        False,
        False,
        speed_m_s,
        None,
    ),
)
PARITY_NAMED = {row.name: row for row in PARITIES}
