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

"""What the integrator of the plant computes with: one unit on the bench, with its faults."""

from __future__ import annotations

from typing import NamedTuple


class Coefficients(NamedTuple):
    """Everything the integrator needs, constant over one call; linear coordinates, SI."""

    resistance: float
    current_decay: float
    force_constant: float
    mass: float
    coulomb: float
    stribeck: float
    stribeck_speed: float
    viscous: float
    load_friction: float
    backlash: float
    lead_error: float
    ripple: float
    ripple_order: float
    eccentric: float
    spall: float
    spall_order: float
    slip: float
    unseen_load: float
    screw_ratio: float
    motor_ratio: float
    cogging: float
    cogging_order: float
    friction_wave: float
    wave_number: float
    nominal_supply: float
    supply: float
    supply_resistance: float
    current_limit: float
    dead_time_drop: float
    bridge: float
    duty: float
    link_turns: float
    link_ripple: float
    link_ohm: float
    leg_resistance: float
    leg_decay: float
    leak: float
    duty_droop: float
    position_gain: float
    position_knee: float
    position_reset: float
    rate_gain: float
    reset_limit: float
    droop: float
    droop_lag: float
    feedback_scale: float
    feedback_offset: float
    feedback_noise: float
    current_feedback_scale: float
    current_feedback_offset: float
    current_feedback_noise: float
    force_feedback_scale: float
    force_feedback_offset: float
    force_feedback_noise: float
    coupling_stiffness: float
    coupling_damping: float
    coupling_holds: float
    load_mass: float
    weight: float
    link_moment: float
    link_level: float
    load_coulomb: float
    load_viscous: float
    load_drag: float
    load_drag_speed: float
    rough_rest: float
    rough_speed: float
    rough_load: float
    load_constant: float
    load_lag: float
    load_stiffness: float
    load_centre: float
    crank: float
    brake: float
    brake_knee: float
    brake_limit: float
    brake_wind: float
    brake_slack: float
    brake_catch: float
    trim_rate: float
    trim_limit: float
    nut_low: float
    nut_high: float
    load_low: float
    load_high: float
    stop_stiffness: float
    stop_damping: float
