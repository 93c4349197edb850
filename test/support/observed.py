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

"""A simulated actuator that shares no code with the observer."""

from __future__ import annotations

import importlib.util
import math
from functools import cache

import numpy as np

from flea_diag.configuration.description import compiled_relations
from flea_diag.core.observers.observer_noise import ObserverNoise
from flea_diag.core.residuals.parameters import ActuatorParameters, UnitTolerance
from flea_diag.core.scan_counts import ScanCounts

FLEA = compiled_relations("actuator.yaml").residuals
FLEA_TOLERANCE = UnitTolerance(10.0, 125.0, 15.0, 0.3, 4.0, 0.5, 0.15, 0.03)
FLEA_COUNTS = ScanCounts(0.01, FLEA.smoothing_s)


def flea_parameters(**known: float) -> ActuatorParameters:
    """An actuator about like the FLEA, but for what is given."""
    near = {
        "force_constant_n_per_a": 177.0,
        "back_emf_v_s_per_m": 177.0,
        "winding_resistance_ohm": 2.95,
        "winding_inductance_h": 0.002,
        "coulomb_friction_n": 50.0,
        "viscous_friction_n_s_per_m": 400.0,
        "stribeck_speed_m_s": 0.004,
        "reflected_mass_kg": 130.0,
        "motor_heating_k_per_a2s": 0.010,
        "motor_cooling_s": 775.0,
        "nut_cooling_s": 775.0,
        "reference_temperature_degc": 25.0,
    }
    return ActuatorParameters(**near | known)


P = flea_parameters(
    voltage_offset_v=1.5,
    current_offset_a=-0.3,
    encoder_m_per_rad=5e-4,
    position_offset_m=0.002,
    nut_heating_k_per_j=0.01,
)
NOISE = ObserverNoise.of(
    ObserverNoise().to_mapping()
    | {"voltage_v": 0.2, "force_n": 40.0, "motor_current_a": 0.053, "motor_speed_rad_s": 2.0}
    | {"motor_temperature_k": 0.57, "nut_temperature_k": 1.1}
)
HAVE_NUMBA = importlib.util.find_spec("numba") is not None
BACKENDS = ["numpy", *(["numba"] if HAVE_NUMBA else [])]


def recording(scans: int = 1200, seed: int = 0, friction: float = 50.0) -> np.ndarray:
    """Rows of readings, a copy for each who asks.

    Those of a stand may be written to as well: for rows that are only read, numba compiles anew.
    """
    return _recorded(scans, seed, friction).copy()


@cache
def _recorded(scans: int, seed: int, friction: float) -> np.ndarray:
    """Newton, Ohm and heat by steps of 0.1 ms, readings averaged or at the end.

    The voltage is what a position loop would give, the load a sine.
    """
    draw = np.random.default_rng(seed)
    speed, position, motor, nut, dt, parts = 0.0, 0.05, 28.0, 26.0, 1e-4, 100
    rows = np.full((scans, len(FLEA.channels)), np.nan)
    for k in range(scans):
        volts = 12.0 * math.sin(math.pi * 0.01 * k)
        load = 150.0 * math.sin(0.4 * math.pi * 0.01 * k) + 40.0 * draw.normal()
        sums = np.zeros(2)
        for _ in range(parts):
            current = (volts - 177.0 * speed) / 2.95
            drag = friction * math.tanh(speed / 0.004) + 400.0 * speed
            speed += dt * (177.0 * current - drag - load) / 130.0
            position += dt * speed
            motor += dt * (0.010 * current**2 - (motor - 24.0) / 775.0)
            nut += dt * (0.01 * 50.0 * abs(speed) - (nut - 24.0) / 775.0)
            sums += (current, speed)
        current, mean_speed = sums / parts
        given = {
            "motor_current": current - 0.3 + 0.053 * draw.normal(),
            "motor_voltage": volts + 1.5 + 0.2 * draw.normal(),
            "motor_speed": mean_speed / 5e-4 + 2.0 * draw.normal(),
            "actuator_position": position + 6e-5 * draw.normal(),
            "load_position": position - 0.002 + 6e-5 * draw.normal(),
            "load_force": load + 2.0 * draw.normal(),
            "motor_temperature": motor + 0.57 * draw.normal(),
            "nut_temperature": nut + 1.1 * draw.normal(),
            "ambient_temperature": 24.0,
        }
        rows[k, [FLEA.index[name] for name in given]] = list(given.values())
    return rows
