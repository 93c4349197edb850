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

"""Parameters of one physical test actuator and of the stand it is mounted on.

Mechanical quantities are in linear coordinates (force along the screw, speed of the nut): the
public FLEA recordings identify the product K * 2 pi / lead, not the lead itself. Values stand in
the file of a machine (``config/machines``). Parts that a machine may lack have a neutral default.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from flea_diag.fields.values import AboveZero, NotNegative


@dataclass(frozen=True)
class SimulatedUnit:
    """Parameters of one test actuator at the reference temperature."""

    winding_resistance_ohm: AboveZero
    winding_inductance_h: AboveZero
    force_constant_n_per_a: AboveZero
    """Of motor and back-EMF alike, at the nut."""
    coulomb_friction_n: float
    stribeck_friction_n: float
    stribeck_speed_m_s: AboveZero
    viscous_friction_n_s_m: float
    load_friction_ratio: float
    reflected_mass_kg: AboveZero
    backlash_m: float
    lead_error_m: float
    ball_pass_ripple_n: float
    lead_m: AboveZero
    screw_pitch_diameter_m: AboveZero
    ball_diameter_m: AboveZero
    contact_angle_rad: float
    ball_spacing: AboveZero
    """Pitch of the balls over their diameter."""
    winding_heat_capacity_j_k: AboveZero
    housing_heat_capacity_j_k: AboveZero
    frame_heat_capacity_j_k: AboveZero
    nut_heat_capacity_j_k: AboveZero
    winding_to_housing_k_w: AboveZero
    housing_to_frame_k_w: AboveZero
    frame_to_ambient_k_w: AboveZero
    nut_to_ambient_k_w: AboveZero
    nut_heat_share: float
    current_offset_a: float
    voltage_offset_v: float
    gear_ratio: float = 1.0
    """Turns of the screw for each turn of the motor."""
    cogging_n: float = 0.0
    """Cogging of the motor, at the nut."""
    cogging_order: float = 0.0
    """Of it, for each turn of the motor."""
    friction_wave: float = 0.0
    """Share by which the dry friction varies along the stroke."""
    friction_wave_length_m: float = 1.0

    @property
    def screw_ratio_m_rad(self) -> float:
        """Travel of the nut per radian of the screw."""
        return self.lead_m / (2.0 * np.pi)

    @property
    def motor_ratio_m_rad(self) -> float:
        """Travel of the nut per radian of the motor."""
        return self.screw_ratio_m_rad * self.gear_ratio


SPREAD_LIMIT = 2.0
"""Draws are truncated at this many standard deviations: a unit beyond would fail acceptance."""
SMALLEST_SHARE = 0.2
"""Smallest ratio of a unit's parameter to its nominal value, for any spread."""


def draw_unit(
    nominal: SimulatedUnit, generator: np.random.Generator, spread: Mapping[str, float]
) -> SimulatedUnit:
    """A unit drawn around the nominal one with these relative standard deviations.

    Every parameter of ``spread`` uses one draw, in the order of the unit's parameters, even if
    its spread is 0.
    """
    draws = np.clip(generator.standard_normal(len(spread)), -SPREAD_LIMIT, SPREAD_LIMIT)
    values: dict[str, Any] = {
        name: getattr(nominal, name) * max(1.0 + share * draw, SMALLEST_SHARE)
        for (name, share), draw in zip(spread.items(), draws, strict=True)
    }
    return replace(nominal, **values)


@dataclass(frozen=True)
class Bench:
    """Shared by both test actuators: drive, control loop, coupling, load side, end stops."""

    supply_v: AboveZero
    supply_resistance_ohm: float
    current_limit_a: AboveZero
    dead_time_drop_v: float
    pwm_frequency_hz: AboveZero
    freewheel_drop_v: float
    position_gain_v_m: float
    position_knee_m: AboveZero
    position_reset_v_m_s: float
    reset_limit_v: float
    droop_ohm: float
    droop_lag_s: AboveZero
    coupling_stiffness_n_m: AboveZero
    coupling_damping_n_s_m: float
    load_mass_kg: AboveZero
    load_coulomb_n: float
    load_drag_n: float
    load_drag_speed_m_s: AboveZero
    load_viscous_n_s_m: float
    load_roughness_n: float
    load_roughness_n_s_m: float
    load_roughness_per_a: float
    load_force_constant_n_per_a: AboveZero
    load_current_lag_s: AboveZero
    brake_a_s_m: float
    brake_knee_n: AboveZero
    brake_limit_a: AboveZero
    brake_wind_n_s: float
    brake_slack_s: float
    brake_catch_m_s: float
    load_trim_per_s: float
    load_trim_limit_n: float
    travel_low_m: float
    travel_high_m: float
    stopped: str
    """Part that the hard stops hold: ``load_side``, beyond the load cell, or ``nut``."""
    end_stop_stiffness_n_m: AboveZero
    end_stop_damping_n_s_m: float
    duty_droop_per_a: float = 0.0
    """Share of the output voltage that a drive without compensation loses for each ampere."""
    supply_ripple: float = 0.0
    """Relative swing of an unregulated supply, which such a drive passes on."""
    supply_ripple_hz: float = 0.0
    load_stiffness_n_m: float = 0.0
    """Of a load side that is held to its centre, as a surface by the airstream."""
    load_centre_m: float = 0.0
    crank_radius_m: float = 0.0
    """Lever of a crank that the nut turns, square to it at ``load_centre_m``; 0: none."""
    gravity_m_s2: float = 0.0
    """By which the load side and its payload pull against extension: 9.81 for a vertical axis."""
    payload_kg: NotNegative = 0.0
    """On the load side, of a scenario that gives none."""
    rate_gain_v_s_m: float = 0.0
    """Of the speed in the position loop, for a machine that its own losses damp too little."""
    payload_arm_m: NotNegative = 0.0
    """From the axis of a link that turns in the vertical plane to its payload; 0: it slides."""
    link_kg_m: float = 0.0
    """Mass of such a link by the distance of its centre from the axis."""
    link_level_rad: float = 0.0
    """Angle at which it lies level, its payload pulling against extension."""
    brake_holds_n: NotNegative = 0.0
    """Dry friction of the holding brake on the motor's side; 0: none."""
