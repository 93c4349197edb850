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

"""The FLEA's relations written down by hand, as an oracle for what is compiled from its graph.

Forces and speeds at the nut, as in the calibration. Nothing that compiles relations is used here.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

import numpy as np

from flea_diag.configuration.description import compiled_relations, faults_of
from flea_diag.core.likelihood.effect_set import EffectSet, effect_set
from flea_diag.core.residuals.parameters import ActuatorParameters
from flea_diag.core.residuals.relation_set import RelationSet

FLEA = compiled_relations("actuator.yaml").residuals

COPPER_PER_K = 0.00393


class Signals(NamedTuple):
    """Smoothed signals, SI: numbers of one scan, or arrays of one for each of many."""

    current_a: Any
    voltage_v: Any
    commanded_voltage_v: Any
    speed_m_s: Any
    acceleration_m_s2: Any
    load_n: Any
    position_m: Any
    load_position_m: Any
    encoder_speed_rad_s: Any
    position_rate_m_s: Any
    direction: Any


def direction(p: ActuatorParameters, speed_m_s: Any) -> Any:
    """Smooth sign of the speed."""
    return np.tanh(speed_m_s / p.stribeck_speed_m_s)


def mechanical_n(p: ActuatorParameters, s: Signals, warm_degc: Any = 25.0) -> Any:
    """Motor force less load, friction and inertia."""
    motor = p.force_constant_n_per_a * (s.current_a - p.current_offset_a)
    dry = (p.coulomb_friction_n + p.load_friction_ratio * abs(s.load_n)) * s.direction
    friction = dry + p.viscous_friction_n_s_per_m * s.speed_m_s
    return motor - s.load_n - friction - p.reflected_mass_kg * s.acceleration_m_s2


def electrical_v(p: ActuatorParameters, s: Signals, warm_degc: Any = 25.0) -> Any:
    """Kirchhoff in the motor circuit, the resistance as warm as the winding."""
    rise = warm_degc - p.reference_temperature_degc
    drop = p.winding_resistance_ohm * (1.0 + COPPER_PER_K * rise)
    current = s.current_a - p.current_offset_a
    return s.voltage_v - p.voltage_offset_v - drop * current - p.back_emf_v_s_per_m * s.speed_m_s


def drive_v(p: ActuatorParameters, s: Signals, warm_degc: Any = 25.0) -> Any:
    """Measured against commanded voltage."""
    return s.voltage_v - p.drive_offset_v - p.drive_gain * s.commanded_voltage_v


def kinematic_m(p: ActuatorParameters, s: Signals, warm_degc: Any = 25.0) -> Any:
    """One position sensor against the other."""
    return s.position_m - p.position_offset_m - s.load_position_m


def speed_m_s(p: ActuatorParameters, s: Signals, warm_degc: Any = 25.0) -> Any:
    """Encoder speed through the screw against the slope of the position."""
    return p.encoder_m_per_rad * s.encoder_speed_rad_s - s.position_rate_m_s


def slope_relations() -> RelationSet:
    """Compiled relations of a FLEA without an encoder: the speed is the slope of the position."""
    motor = ("motor_current", "motor_voltage", "commanded_voltage")
    moved = ("actuator_position", "load_position", "load_force")
    return compiled_relations("actuator.yaml", (*motor, *moved, *tuple(FLEA.predictions)), False)


BY_HAND: dict[str, Callable[..., Any]] = {
    "parity_mechanical": mechanical_n,
    "parity_electrical": electrical_v,
    "parity_drive": drive_v,
    "parity_kinematic": kinematic_m,
    "parity_speed": speed_m_s,
}


def catalogue_effects(relations: RelationSet) -> EffectSet:
    """Effects of the shipped catalogue on these relations."""
    return effect_set(relations, faults_of("actuator.yaml", "faults.yaml").values())


def channels_of(p: ActuatorParameters, s: Signals, warm_degc: Any = 25.0) -> dict[str, Any]:
    """The same signals by the names that compiled relations know them by."""
    lead = p.encoder_m_per_rad or 1.0
    return {
        "motor_current": s.current_a,
        "motor_voltage": s.voltage_v,
        "commanded_voltage": s.commanded_voltage_v,
        "load_force": s.load_n,
        "motor_speed": s.speed_m_s / lead,
        "d_motor_speed": s.acceleration_m_s2 / lead,
        "actuator_position": s.position_m,
        "d_actuator_position": s.position_rate_m_s,
        "d_d_actuator_position": s.acceleration_m_s2,
        "load_position": s.load_position_m,
        "winding_temperature": warm_degc,
        "direction": s.direction,
    }


def _motor_k_per_s(p: ActuatorParameters, s: Signals, degc: Mapping[str, float]) -> float:
    """One node of winding and housing; copper losses of the cold winding."""
    excess = s.current_a - p.current_offset_a
    lost = (degc["motor_temperature"] - degc["ambient_temperature"]) / p.motor_cooling_s
    return float(p.motor_heating_k_per_a2s * excess * excess - lost)


def _nut_k_per_s(p: ActuatorParameters, s: Signals, degc: Mapping[str, float]) -> float:
    """Heated by dry friction; what grows with load and speed is neglected."""
    rubbing = p.nut_heating_k_per_j * p.coulomb_friction_n * s.direction * s.speed_m_s
    lost = (degc["nut_temperature"] - degc["ambient_temperature"]) / p.nut_cooling_s
    return float(rubbing - lost)


HEATED_BY_HAND: dict[str, Callable[..., float]] = {
    "motor_temperature": _motor_k_per_s,
    "nut_temperature": _nut_k_per_s,
    "ambient_temperature": lambda p, s, degc: 0.0,
}
