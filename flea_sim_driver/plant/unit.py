"""Parameters of one physical test actuator and of the stand it is mounted on.

Mechanical quantities are in linear coordinates (force along the screw, speed of the nut): the
public FLEA recordings identify the product K * 2 pi / lead, not the lead itself. Values marked
(measured) were regressed from those recordings; the others are assumptions.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields, make_dataclass, replace
from typing import Any

import numpy as np

from flea_diag.wire.parameters import parameter


@dataclass(frozen=True)
class SimulatedUnit:
    """Parameters of one test actuator at 25 degC."""

    winding_resistance_ohm: float = 2.95  # measured
    winding_inductance_h: float = 1.35e-3  # times the PWM frequency: 1.3 ohm (measured)
    force_constant_n_per_a: float = 176.7  # measured: K * 2 pi / lead, motor and back-EMF
    coulomb_friction_n: float = 39.0  # measured 47 together with the load-dependent part
    stribeck_friction_n: float = 10.0
    stribeck_speed_m_s: float = 2.5e-3
    viscous_friction_n_s_m: float = 412.0  # measured
    load_friction_ratio: float = 0.05
    reflected_mass_kg: float = 130.0  # measured 110 to 152
    backlash_m: float = 20e-6
    lead_error_m: float = 8e-6
    ball_pass_ripple_n: float = 4.0
    lead_m: float = 3.175e-3
    screw_pitch_diameter_m: float = 9.9e-3
    ball_diameter_m: float = 1.588e-3
    contact_angle_rad: float = np.pi / 4
    winding_heat_capacity_j_k: float = 40.0
    housing_heat_capacity_j_k: float = 262.0
    frame_heat_capacity_j_k: float = 600.0
    nut_heat_capacity_j_k: float = 60.0
    winding_to_housing_k_w: float = 0.5
    housing_to_frame_k_w: float = 3.6
    frame_to_ambient_k_w: float = 2.5
    nut_to_ambient_k_w: float = 4.0
    nut_heat_share: float = 0.6
    current_offset_a: float = 0.32  # measured, on every motor
    voltage_offset_v: float = -1.35  # measured -1.0 to -1.7

    @property
    def screw_ratio_m_rad(self) -> float:
        """Travel of the nut per radian of the motor."""
        return self.lead_m / (2.0 * np.pi)


UNIT_SPREAD: dict[str, float] = {
    "winding_resistance_ohm": 0.05,
    "winding_inductance_h": 0.05,
    "force_constant_n_per_a": 0.01,
    "coulomb_friction_n": 0.10,
    "stribeck_friction_n": 0.20,
    "viscous_friction_n_s_m": 0.15,
    "load_friction_ratio": 0.15,
    "reflected_mass_kg": 0.08,
    "backlash_m": 0.25,
    "lead_error_m": 0.25,
    "ball_pass_ripple_n": 0.25,
    "housing_heat_capacity_j_k": 0.03,
    "housing_to_frame_k_w": 0.10,
    "frame_to_ambient_k_w": 0.10,
    "nut_heat_capacity_j_k": 0.05,
    "nut_to_ambient_k_w": 0.10,
    "current_offset_a": 0.03,
    "voltage_offset_v": 0.12,
}
"""One standard deviation of each parameter between units, relative, at ``unit_spread`` 1."""

SPREAD_LIMIT = 2.0
"""Draws are truncated at this many standard deviations: a unit beyond would fail acceptance."""
SMALLEST_SHARE = 0.2
"""Smallest ratio of a unit's parameter to its nominal value, for any spread."""

Spread: Any = make_dataclass(
    "Spread",
    [
        (
            name,
            float,
            parameter(value, f"of {name} between units, relative", minimum=0.0, maximum=1.0),
        )
        for name, value in UNIT_SPREAD.items()
    ],
    frozen=True,
)
"""One standard deviation of each parameter, as given by a scenario."""


def draw_unit(generator: np.random.Generator, spread: Mapping[str, float]) -> SimulatedUnit:
    """A unit drawn around the nominal one with these relative standard deviations.

    Every parameter uses one draw, even if its spread is 0.
    """
    names = [entry.name for entry in fields(SimulatedUnit) if entry.name in UNIT_SPREAD]
    draws = np.clip(generator.standard_normal(len(names)), -SPREAD_LIMIT, SPREAD_LIMIT)
    nominal = SimulatedUnit()
    values = {
        name: getattr(nominal, name) * max(1.0 + spread[name] * draw, SMALLEST_SHARE)
        for name, draw in zip(names, draws, strict=True)
    }
    return replace(nominal, **values)


@dataclass(frozen=True)
class Bench:
    """Shared by both test actuators: drive, control loop, coupling, load actuator, end stops.

    The position loop and the load actuator were fitted together to strokes, loads and currents
    of one half of the public recordings (``flea realism`` shows the other half).
    """

    supply_v: float = 24.3
    supply_resistance_ohm: float = 0.08
    current_limit_a: float = 8.0
    dead_time_drop_v: float = 0.3
    pwm_frequency_hz: float = 988.3  # aliases to the 11.7 Hz line of the 100 Hz recordings
    freewheel_drop_v: float = 0.8
    position_gain_v_m: float = 923.0
    position_knee_m: float = 0.00248
    position_reset_v_m_s: float = 77.5
    reset_limit_v: float = 7.22
    droop_ohm: float = 3.64
    droop_lag_s: float = 5e-3
    coupling_stiffness_n_m: float = 5e6
    coupling_damping_n_s_m: float = 8e3
    load_mass_kg: float = 233.0
    load_coulomb_n: float = 29.6
    load_drag_n: float = 1.01
    load_drag_speed_m_s: float = 0.017
    load_viscous_n_s_m: float = 1670.0
    load_roughness_n: float = 2.5
    load_roughness_n_s_m: float = 2400.0
    load_roughness_per_a: float = 0.647
    load_force_constant_n_per_a: float = 176.7
    load_current_lag_s: float = 0.002
    brake_a_s_m: float = 229.0
    brake_knee_n: float = 19.6
    brake_limit_a: float = 3.76
    brake_wind_n_s: float = 59.0
    brake_slack_s: float = 0.164
    brake_catch_m_s: float = 0.0729
    load_trim_per_s: float = 0.1
    load_trim_limit_n: float = 86.6
    travel_low_m: float = 0.0
    travel_high_m: float = 0.100
    stopped: str = "load_side"
    """Part that the hard stops hold: ``load_side``, beyond the load cell, or ``nut``."""
    end_stop_stiffness_n_m: float = 2e6
    end_stop_damping_n_s_m: float = 6e3
