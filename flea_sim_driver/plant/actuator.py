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

"""The mechanics and electrics of one block: a unit on the bench, with its active faults."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from flea_sim_driver.plant.coefficients import Coefficients
from flea_sim_driver.plant.plant import SIGNALS, STATES, STEP_S, integrator
from flea_sim_driver.plant.unit import Bench, SimulatedUnit
from flea_sim_driver.plant.vibration import ball_pass_order
from flea_sim_driver.schedule import FaultCourse

Array = npt.NDArray[np.float64]
Sizes = tuple[float | None, ...]


HEALTHY: dict[str, float] = {
    "coupling_holds": math.inf,
    "eccentric": 0.0,
    "spall": 0.0,
    "slip": 0.0,
    "unseen_load": 0.0,
    "bridge": 1.0,
    "link_turns": 0.0,
    "link_ripple": 0.0,
    "link_ohm": 0.0,
    "leg_resistance": 0.0,
    "leg_decay": 0.0,
    "leak": 0.0,
    "feedback_scale": 1.0,
    "feedback_offset": 0.0,
    "feedback_noise": 0.0,
    "current_feedback_scale": 1.0,
    "current_feedback_offset": 0.0,
    "current_feedback_noise": 0.0,
    "force_feedback_scale": 1.0,
    "force_feedback_offset": 0.0,
    "force_feedback_noise": 0.0,
}
"""What only faults change, or a magnet that has just been switched on."""


def coefficients(unit: SimulatedUnit, bench: Bench, time_s: float = 0.0) -> Coefficients:
    """The integrator's coefficients of a healthy unit on the bench, at a time of the run."""
    ripple = bench.supply_ripple * math.sin(2.0 * math.pi * bench.supply_ripple_hz * time_s)
    return Coefficients(
        **_unit_coefficients(unit), **_bench_coefficients(bench), **HEALTHY, duty=1.0 + ripple
    )


def _unit_coefficients(unit: SimulatedUnit) -> dict[str, float]:
    """Motor and screw."""
    lag = unit.winding_resistance_ohm / unit.winding_inductance_h
    order = ball_pass_order(unit)
    return {
        "resistance": unit.winding_resistance_ohm,
        "current_decay": float(np.exp(-STEP_S * lag)),
        "force_constant": unit.force_constant_n_per_a,
        "mass": unit.reflected_mass_kg,
        "coulomb": unit.coulomb_friction_n,
        "stribeck": unit.stribeck_friction_n,
        "stribeck_speed": unit.stribeck_speed_m_s,
        "viscous": unit.viscous_friction_n_s_m,
        "load_friction": unit.load_friction_ratio,
        "backlash": unit.backlash_m,
        "lead_error": unit.lead_error_m,
        "ripple": unit.ball_pass_ripple_n,
        "ripple_order": order,
        "spall_order": order,
        "screw_ratio": unit.screw_ratio_m_rad,
        "motor_ratio": unit.motor_ratio_m_rad,
        "cogging": unit.cogging_n,
        "cogging_order": unit.cogging_order,
        "friction_wave": unit.friction_wave,
        "wave_number": 2.0 * math.pi / unit.friction_wave_length_m,
    }


def _bench_coefficients(bench: Bench) -> dict[str, float]:
    """Drive, control loop, coupling, load actuator and end stops."""
    return {
        "nominal_supply": bench.supply_v,
        "supply": bench.supply_v,
        "supply_resistance": bench.supply_resistance_ohm,
        "current_limit": bench.current_limit_a,
        "dead_time_drop": bench.dead_time_drop_v,
        "duty_droop": bench.duty_droop_per_a,
        "position_gain": bench.position_gain_v_m,
        "position_knee": bench.position_knee_m,
        "position_reset": bench.position_reset_v_m_s,
        "rate_gain": bench.rate_gain_v_s_m,
        "reset_limit": bench.reset_limit_v,
        "droop": bench.droop_ohm,
        "droop_lag": bench.droop_lag_s,
        "coupling_stiffness": bench.coupling_stiffness_n_m,
        "coupling_damping": bench.coupling_damping_n_s_m,
        **_carried(bench),
        "load_coulomb": bench.load_coulomb_n,
        "load_viscous": bench.load_viscous_n_s_m,
        "load_drag": bench.load_drag_n,
        "load_drag_speed": bench.load_drag_speed_m_s,
        "rough_rest": bench.load_roughness_n,
        "rough_speed": bench.load_roughness_n_s_m,
        "rough_load": bench.load_roughness_per_a,
        "load_constant": bench.load_force_constant_n_per_a,
        "load_lag": bench.load_current_lag_s,
        "load_stiffness": bench.load_stiffness_n_m,
        "load_centre": bench.load_centre_m,
        "crank": bench.crank_radius_m,
        "brake": bench.brake_a_s_m,
        "brake_knee": bench.brake_knee_n,
        "brake_limit": bench.brake_limit_a,
        "brake_wind": bench.brake_wind_n_s,
        "brake_slack": bench.brake_slack_s,
        "brake_catch": bench.brake_catch_m_s,
        "trim_rate": bench.load_trim_per_s,
        "trim_limit": bench.load_trim_limit_n,
        **_stops(bench),
        "stop_stiffness": bench.end_stop_stiffness_n_m,
        "stop_damping": bench.end_stop_damping_n_s_m,
    }


def _carried(bench: Bench) -> dict[str, float]:
    """Inertia and weight of the load side with its payload: a carriage, or a link that turns."""
    turning = bench.payload_arm_m > 0.0
    moment = bench.link_kg_m + bench.payload_kg * bench.payload_arm_m
    payload = bench.payload_kg * (bench.payload_arm_m**2 if turning else 1.0)
    mass = bench.load_mass_kg + payload
    return {
        "load_mass": mass,
        "weight": 0.0 if turning else bench.gravity_m_s2 * mass,
        "link_moment": bench.gravity_m_s2 * moment if turning else 0.0,
        "link_level": bench.link_level_rad,
    }


def _stops(bench: Bench) -> dict[str, float]:
    """Ends of travel of nut and load side; none for the part that the hard stops do not hold."""
    held = {"low": bench.travel_low_m, "high": bench.travel_high_m}
    free = {"low": -math.inf, "high": math.inf}
    nut, load = (held, free) if bench.stopped == "nut" else (free, held)
    return {
        f"{part}_{end}": row[end] for part, row in (("nut", nut), ("load", load)) for end in row
    }


FEEDBACK = {
    "actuator_position": "feedback",
    "motor_current": "current_feedback",
    "load_force": "force_feedback",
}


def with_faults(
    healthy: Coefficients, courses: tuple[FaultCourse, ...], sizes: Sizes, time_s: float
) -> Coefficients:
    """The coefficients with every active fault of the plant or the control loop."""
    changed = healthy
    for course, size in zip(courses, sizes, strict=True):
        if size is None:
            continue
        if course.row.change is not None:
            changed = course.row.change(changed, size)
        elif course.setting.where == "loop":
            changed = _with_feedback(changed, course, size, time_s)
    return changed


def _with_feedback(
    c: Coefficients, course: FaultCourse, size: float, time_s: float
) -> Coefficients:
    """A faulty sensor as the control loop sees it: scale and offset of its reading."""
    name = FEEDBACK[course.row.channel]
    values = c._asdict()
    scale, offset = values[f"{name}_scale"], values[f"{name}_offset"]
    mode = course.row.mode
    if mode == "bias":
        offset += size
    elif mode == "drift":
        offset += size * (time_s - course.onset_s)
    elif mode == "scaling":
        scale, offset = scale * size, offset * size
    elif mode == "dead":
        scale, offset = 0.0, size
    elif mode == "dropout" and course.in_gap(size, time_s):
        scale, offset = 0.0, 0.0
    elif mode == "noise":
        values[f"{name}_noise"] = size
    return Coefficients(**{**values, f"{name}_scale": scale, f"{name}_offset": offset})


@dataclass
class ActuatorPlant:
    """State of the machine, advanced block by block."""

    bench: Bench
    state: Array

    @classmethod
    def at_rest(cls, bench: Bench, position_m: float, holds_v: float = 0.0) -> ActuatorPlant:
        """Both sides at rest at one position; ``holds_v`` is what the loop holds a weight by."""
        state = np.zeros(len(STATES))
        state[STATES.index("position")] = state[STATES.index("load_position")] = position_m
        state[STATES.index("wish")] = holds_v
        return cls(bench, state)

    def advance(
        self, segments: list[tuple[int, Coefficients]], reference: Array, load: Array, noise: Array
    ) -> Array:
        """Signals (steps, SIGNALS) over segments, each a number of steps and coefficients."""
        out = np.empty((len(reference), len(SIGNALS)))
        run, start = integrator(), 0
        for steps, values in segments:
            cut = slice(start, start + steps)
            run(self.state, reference[cut], load[cut], noise[cut], values, STEP_S, out[cut])
            start += steps
        return out
