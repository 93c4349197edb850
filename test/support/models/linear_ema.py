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

"""A linear actuator integrated step by step, as the oracle for residuals and identification.

Nothing of the package is used here. Motion along the screw, quasi-static motor circuit, copper
winding, one thermal node:

    M v' = K i - F - fc tanh(v / 4 mm/s) - B v        x' = v
    i = (V - Ke v) / R                                R = R25 (1 + 0.0039 (T - 25 degC))
    T' = h i^2 - (T - 24 degC) / tau

A position loop drives the voltage; fourth-order Runge-Kutta in steps of 1 ms, read at 100 Hz.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np

PERIOD_S = 0.01
COPPER_PER_K = 0.00393
CHANNELS = (
    "motor_current",
    "motor_voltage",
    "commanded_voltage",
    "motor_speed",
    "actuator_position",
    "load_position",
    "load_force",
    "motor_temperature",
    "nut_temperature",
    "ambient_temperature",
)
STAND = tuple(c for c in CHANNELS if c not in ("commanded_voltage", "motor_speed", "load_position"))
"""Channels of a stand like the FLEA: no encoder, no command, one position."""
NOISE = dict(zip(CHANNELS, (0.05, 0.3, 0.0, 0.2, 6e-5, 6e-5, 2.0, 0.4, 0.8, 0.003), strict=True))
Columns = dict[str, np.ndarray]


@dataclass(frozen=True)
class Actuator:
    """True parameters; offsets are those of the current and voltage channels."""

    force_constant: float = 170.0
    back_emf: float = 170.0
    resistance: float = 3.1
    coulomb: float = 60.0
    viscous: float = 500.0
    mass: float = 120.0
    current_offset: float = 0.25
    voltage_offset: float = -0.8
    heating: float = 0.0098
    cooling_s: float = 800.0
    lead_m_per_rad: float = 5e-4


HEALTHY = Actuator()


def triangle(amplitude_m: float, period_s: float) -> Callable[[float], float]:
    """Long stretches of constant speed, 4 amplitude / period."""
    return lambda t: amplitude_m * (2.0 / math.pi) * math.asin(math.sin(2 * math.pi * t / period_s))


def sine(amplitude_m: float, period_s: float) -> Callable[[float], float]:
    """A speed that is never the same."""
    return lambda t: amplitude_m * math.sin(2 * math.pi * t / period_s)


def run(
    actuator: Actuator = HEALTHY,
    seconds: float = 20.0,
    reference: Callable[[float], float] | None = None,
    load: Callable[[float], float] = lambda t: 60.0 + 40.0 * math.sin(1.3 * t),
    faulty: Actuator | None = None,
    onset_s: float = math.inf,
) -> Columns:
    """Noise-free readings at 100 Hz; from ``onset_s`` on the actuator is ``faulty``."""
    reference = reference or triangle(0.04, 4.0)
    x, v, motor, h = 0.0, 0.0, 30.0, 1e-3
    rows = []
    for step in range(round(seconds / h)):
        t = step * h
        p = faulty if faulty is not None and t >= onset_s else actuator
        volts = min(max(900.0 * (reference(t) - x), -24.0), 24.0)
        force, ohms = load(t), p.resistance * (1.0 + COPPER_PER_K * (motor - 25.0))

        def slope(speed: float, p=p, volts=volts, force=force, ohms=ohms) -> float:
            current = (volts - p.back_emf * speed) / ohms
            drag = p.coulomb * math.tanh(speed / 0.004) + p.viscous * speed
            return (p.force_constant * current - force - drag) / p.mass

        amps = (volts - p.back_emf * v) / ohms
        if step % 10 == 0:
            rows.append(
                (
                    amps + p.current_offset,
                    volts + p.voltage_offset,
                    volts,
                    v / p.lead_m_per_rad,
                    0.05 + x,
                    0.05 + x,
                    force,
                    motor,
                    27.0,
                    24.0,
                )
            )
        a = slope(v)
        b = slope(v + 0.5 * h * a)
        c = slope(v + 0.5 * h * b)
        d = slope(v + h * c)
        x += h * (v + h * (a + b + c) / 6.0)
        v += h * (a + 2 * b + 2 * c + d) / 6.0
        motor += h * (p.heating * amps * amps - (motor - 24.0) / p.cooling_s)
    return dict(zip(CHANNELS, np.array(rows).T, strict=True))


def noisy(columns: Columns, seed: int) -> Columns:
    """The same with white noise on every channel."""
    random = np.random.default_rng(seed)
    return {
        name: values + NOISE[name] * random.standard_normal(len(values))
        for name, values in columns.items()
    }


def rows(columns: Columns, channels: tuple[str, ...] = CHANNELS) -> np.ndarray:
    """Shape (scans, channels), NaN for channels that the stand does not have."""
    empty = np.full(len(columns["motor_current"]), np.nan)
    return np.stack([columns[c] if c in channels else empty for c in CHANNELS], axis=1)


MOTIONS = (
    (triangle(0.04, 4.0), 60.0),
    (sine(0.03, 4.0), -60.0),
    (triangle(0.02, 2.0), 20.0),
    (sine(0.014, 2.0), -20.0),
    (sine(0.035, 4.0), 100.0),
    (triangle(0.03, 4.0), -100.0),
)


@lru_cache(maxsize=1)
def nominal_runs() -> tuple[Columns, ...]:
    """Six healthy runs of 24 s with noise, motions and loads of all kinds."""
    return tuple(
        noisy(run(HEALTHY, 24.0, motion, lambda t, mean=mean: mean + 40.0 * math.sin(1.3 * t)), n)
        for n, (motion, mean) in enumerate(MOTIONS)
    )


def changed(**values: float) -> Actuator:
    """The healthy actuator with other parameters."""
    return replace(HEALTHY, **values)
