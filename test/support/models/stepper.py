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

"""A stepper behind a drive of which only the supply current is known, and its power, step by step.

Nothing of the package is used here. At the nut, with the position, the supply current and the
commanded load recorded at 25 Hz:

    V (i - i0) = (fc s + B v + F + M v') v
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

LEAD = 0.005 / (2.0 * math.pi)
DESCRIPTION: dict[str, Any] = {
    "schema_version": 1,
    "name": "stepper",
    "scan_period_s": 0.04,
    "parameters": {
        "supply_voltage": {"value": 60.0, "unit": "V"},
        "idle_current": {"value": 0.42, "unit": "A"},
        "duty": {"value": 3.0, "unit": "V/N/m"},
        "rotor_inertia": {"value": 3.0e-4, "unit": "kg*m^2"},
        "coulomb": {"value": 0.1, "unit": "N*m"},
        "viscous": {"value": 2.0e-3, "unit": "N*m*s/rad"},
        "smooth_speed": {"value": 3.0, "unit": "rad/s"},
        "screw_ratio": {"value": LEAD, "unit": "m/rad"},
    },
    "junctions": {
        "supply_side": {"type": "1", "domain": "electrical"},
        "shaft": {"type": "1", "domain": "rotation"},
        "nut": {"type": "1", "domain": "translation"},
    },
    "elements": {
        "supply": {
            "type": "Se",
            "law": "constant_effort",
            "parameters": {"level": "supply_voltage"},
        },
        "drive": {"type": "TF", "law": "converter", "parameters": {"ratio": "duty"}},
        "rotor": {"type": "I", "state": "omega", "parameters": {"inertia": "rotor_inertia"}},
        "friction": {
            "type": "R",
            "law": "friction",
            "parameters": {
                "coulomb": "coulomb",
                "viscous": "viscous",
                "smooth_flow": "smooth_speed",
            },
        },
        "screw": {"type": "TF", "parameters": {"ratio": "screw_ratio"}},
        "load": {"type": "MSe", "signal": "commanded_load"},
    },
    "bonds": [
        "supply -> supply_side",
        "supply_side -> drive",
        "drive -> shaft",
        "shaft -> rotor",
        "shaft -> friction",
        "shaft -> screw",
        "screw -> nut",
        "nut -> load",
    ],
    "sensors": {
        "motor_current": {
            "at": "supply_side",
            "unit": "A",
            "noise": 0.01,
            "offset": "idle_current",
        },
        "actuator_position": {
            "at": "nut",
            "unit": "m",
            "noise": 1e-5,
            "integrates": True,
            "state": "x_nut",
        },
    },
    "inputs": {"commanded_load": {"unit": "N"}},
    "operating_point": {
        "hold": {"motor_current": 0.5},
        "by": ["commanded_load"],
        "fixed": {"x_nut": 0.1},
    },
    "residuals": {
        "parity_power": {
            "kind": "power",
            "junctions": ["supply_side", "shaft", "nut"],
            "unit": "W",
        },
    },
    "tolerances": {
        "coulomb_friction_n": "1 %",
        "viscous_friction_n_s_per_m": "1 %",
        "reflected_mass_kg": "1 %",
        "current_offset_a": "1 %",
    },
    "base_parameters": {
        "supply_voltage_v": "supply_voltage",
        "current_offset_a": "idle_current",
        "reflected_mass_kg": "rotor_inertia/screw_ratio^2",
        "coulomb_friction_n": "coulomb/screw_ratio",
        "viscous_friction_n_s_per_m": "viscous/screw_ratio^2",
        "stribeck_speed_m_s": "smooth_speed*screw_ratio",
        "encoder_m_per_rad": "screw_ratio",
    },
}
PERIOD_S = 0.04
CHANNELS = ("motor_current", "actuator_position", "commanded_load")
SUPPLY_V, IDLE_A, DRY_N, VISCOUS, MASS_KG = 48.0, 0.4, 150.0, 3000.0, 500.0
FASTEST, RATE_M_S2, LOAD_N = 0.04, 0.05, 400.0
Columns = dict[str, np.ndarray]


def run(number: int, seconds: float = 120.0, drag_n: float = 0.0, onset_s: float = 0.0) -> Columns:
    """Strokes both ways with rests, slower ones in some runs; from ``onset_s`` on with a drag."""
    draw = np.random.default_rng(number)
    time_s = np.arange(0.0, seconds, PERIOD_S)
    cycle_s, fastest = 20.0 + number % 3, FASTEST * (0.6 + 0.2 * (number % 3))
    phase = time_s % cycle_s / cycle_s
    wanted = np.select([phase < 0.4, phase < 0.5, phase < 0.9], [fastest, 0.0, -fastest], 0.0)
    speed = np.zeros(len(time_s))
    for k in range(1, len(speed)):
        step = np.clip(wanted[k] - speed[k - 1], -RATE_M_S2 * PERIOD_S, RATE_M_S2 * PERIOD_S)
        speed[k] = speed[k - 1] + step
    rate = np.gradient(speed, PERIOD_S)
    load = LOAD_N * np.sin(2.0 * np.pi * time_s / 37.0 + number)
    dry = DRY_N + np.where(time_s >= onset_s, drag_n, 0.0)
    power = (dry * np.tanh(speed / 0.002) + VISCOUS * speed + load + MASS_KG * rate) * speed
    return {
        "motor_current": IDLE_A + power / SUPPLY_V + 0.01 * draw.standard_normal(len(speed)),
        "actuator_position": 0.1
        + np.cumsum(speed) * PERIOD_S
        + 1e-5 * draw.standard_normal(len(speed)),
        "commanded_load": load,
    }


def rows(columns: Columns) -> np.ndarray:
    """Shape (scans, channels)."""
    return np.stack([columns[name] for name in CHANNELS], axis=1)
