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

"""The FLEA's driven model written down by hand, as an oracle for what is compiled from its graph.

    i   = i0 + (V - V0 - Ke v) / R(T)
    M v' = K (i - i0) - (fc + c|F|) s(v) - B v - F           s(v) = tanh(v / v_s)
    x'  = v

Linear part exact for inputs held over a scan, friction by the two-stage exponential rule.
"""

from __future__ import annotations

import math

import numpy as np

from flea_diag.core.residuals.parameters import ActuatorParameters

COPPER_PER_K = 0.00393
Array = np.ndarray


def resistance_ohm(p: ActuatorParameters, rise_k: float) -> float:
    return p.winding_resistance_ohm * (1.0 + COPPER_PER_K * rise_k)


def readings(p: ActuatorParameters, rise_k: float) -> tuple[Array, Array]:
    """H, shape (5, 4), and h: current, voltage, encoder, both positions by the four states."""
    R, rows = resistance_ohm(p, rise_k), np.zeros((5, 4))
    rows[0, :2] = 1.0 / R, -p.back_emf_v_s_per_m / R
    rows[1, 0] = 1.0
    rows[2, 1] = 1.0 / p.encoder_m_per_rad if p.encoder_m_per_rad else 0.0
    rows[3, 3] = rows[4, 3] = 1.0
    current = p.current_offset_a - p.voltage_offset_v / R
    return rows, np.array([current, 0.0, 0.0, 0.0, -p.position_offset_m])


def transition(
    p: ActuatorParameters, rise_k: float, T: float, x: Array, u: Array, pwm: bool
) -> Array:
    """States one scan later, (4, N) -> (4, N); a missing load is what keeps forces in balance."""
    R, K, M = resistance_ohm(p, rise_k), p.force_constant_n_per_a, p.reflected_mass_kg
    damping = K * p.back_emf_v_s_per_m / R + p.viscous_friction_n_s_per_m
    decay = math.exp(-damping * T / M)
    kept = (1.0 - decay) * M / (damping * T)
    gained, averaged = (1.0 - decay) / damping, (1.0 - kept) / damping
    voltage, mean_speed, speed, position = x
    V, load = u
    way = np.tanh(speed / p.stribeck_speed_m_s)
    current = (voltage - p.voltage_offset_v - p.back_emf_v_s_per_m * mean_speed) / R
    if math.isnan(load):
        dry = p.coulomb_friction_n * way
        load = K * current - dry - p.viscous_friction_n_s_per_m * speed
    if not (pwm or math.isnan(V)):
        voltage = np.full_like(voltage, V)
    drive = K / R * (voltage - p.voltage_offset_v) - load
    dry = p.coulomb_friction_n + p.load_friction_ratio * np.abs(load)
    first = drive - dry * way
    half = decay * speed + gained * first
    second = drive - dry * np.tanh(half / p.stribeck_speed_m_s) - first
    mean = kept * speed + averaged * (first + 0.5 * second)
    return np.array([voltage, mean, half + averaged * second, position + T * mean])


def process_noise(
    p: ActuatorParameters, rise_k: float, T: float, volt: float, newton: float, walk_m: float
) -> Array:
    """Covariance of what one scan adds for these standard deviations of voltage and force."""
    R, K, M = resistance_ohm(p, rise_k), p.force_constant_n_per_a, p.reflected_mass_kg
    damping = K * p.back_emf_v_s_per_m / R + p.viscous_friction_n_s_per_m
    decay = math.exp(-damping * T / M)
    averaged = (1.0 - (1.0 - decay) * M / (damping * T)) / damping
    per_newton = np.array([0.0, averaged, (1.0 - decay) / damping, T * averaged])
    per_volt = K / R * per_newton
    per_volt[0] = 1.0
    noise = volt**2 * np.outer(per_volt, per_volt) + newton**2 * np.outer(per_newton, per_newton)
    return noise + np.diag([0.0, 0.0, 0.0, walk_m**2])
