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

"""A plant that shares nothing with the shipped simulation: two masses, bristles, heat, a cascade.

    L i' = u U / U_0 (1 - w) - R i - k v,   u from a PI of the current, that from a PI of the speed
    m v' = k i - F(v, z) - s,   s = c (x - y) + d (v - v_y)
    M v_y' = s - weight(y)
    z' = v - |v| z c_0 / g(v),   F = c_0 z + c_1 z' + b v   (Canudas de Wit et al. 1995)

The motor's side is ``x``, the load's ``y``, both in the unit of the load: m, or rad of an arm.
Friction falls as the housing warms up, magnets weaken, copper resists more.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from numba import njit

Array = npt.NDArray[np.float64]
STEP_S, SCAN_S = 0.5e-3, 0.01
STEPS = round(SCAN_S / STEP_S)
SIGNALS = ("current", "voltage", "command", "speed", "place", "far_place", "bus", "degc")
GRAVITY = 9.81


class Numbers(NamedTuple):
    """What the integrator takes; all at the load, SI."""

    resistance: float
    inductance: float
    constant: float
    mass: float
    load_mass: float
    stiffness: float
    damping: float
    dry: float
    sticks: float
    stick_speed: float
    bristles: float
    bristle_damping: float
    viscous: float
    per_kelvin: float
    weight: float
    level: float
    turns: float
    supply: float
    duty: float
    share: float
    supply_resistance: float
    ripple: float
    weak: float
    limit: float
    winding_capacity: float
    housing_capacity: float
    between: float
    outwards: float
    ambient: float
    place_gain: float
    speed_gain: float
    speed_reset: float


@dataclass(frozen=True)
class Course:
    """A motion: where the load is to be and how fast, at each step."""

    place: Array
    speed: Array


@njit(cache=True)
def _run(c, place, speed, until, other, out):  # type: ignore[no-untyped-def]
    """Fill ``out``, shape (steps, signals); from step ``until`` on the numbers are ``other``."""
    dt = 0.5e-3
    i = v = vy = z = integral = 0.0
    x = y = place[0]
    winding = housing = c.ambient + 4.0
    for k in range(len(place)):
        p = c if k < until else other
        warm = housing - 25.0
        r = p.resistance * (1.0 + 3.93e-3 * (winding - 25.0))
        constant = p.constant * (1.0 - 1.0e-3 * warm)
        wanted = p.place_gain * (place[k] - x) + speed[k]
        integral += dt * p.speed_reset * (wanted - v)
        asked = (p.speed_gain * (wanted - v) + integral) / c.constant
        asked = min(max(asked, -p.limit), p.limit)
        command = c.resistance * asked + c.constant * v + 0.5 * c.inductance / dt * (asked - i)
        command = min(max(command, -p.duty), p.duty)
        bus = p.supply * p.share - p.supply_resistance * abs(i)
        bus += p.ripple * math.sin(2.0 * math.pi * 0.31 * k * dt)
        voltage = command * bus / p.duty * (1.0 - p.weak)
        decay = math.exp(-dt * r / p.inductance)
        settled = (voltage - constant * v) / r
        i = settled + (i - settled) * decay
        thin = max(1.0 + p.per_kelvin * warm, 0.2)
        level = thin * (p.dry + p.sticks * math.exp(-((v / p.stick_speed) ** 2)))
        bent = (z + dt * v) / (1.0 + dt * p.bristles * abs(v) / level)
        rate = (bent - z) / dt
        z = bent
        friction = p.bristles * z + p.bristle_damping * rate + p.viscous * thin * v
        spring = p.stiffness * (x - y) + p.damping * (v - vy)
        v += dt * (constant * i - friction - spring) / p.mass
        x += dt * v
        pull = p.weight * (math.cos(y - p.level) if p.turns > 0.0 else 1.0)
        vy += dt * (spring - pull) / p.load_mass
        y += dt * vy
        lost = (winding - housing) / p.between
        winding += dt * (r * i * i - lost) / p.winding_capacity
        housing += dt * (lost - (housing - p.ambient) / p.outwards) / p.housing_capacity
        row = out[k]
        row[0], row[1], row[2], row[3] = i, voltage, command, v
        row[4], row[5], row[6], row[7] = x, y, bus, housing


def simulated(
    numbers: Numbers, course: Course, onset_s: float, faulty: Numbers
) -> dict[str, Array]:
    """Means of each scan, but the last of places and temperatures; shape (scans,) each."""
    steps = len(course.place) // STEPS * STEPS
    settle = round(3.0 / STEP_S)
    still = np.full(settle, course.place[0])
    place = np.concatenate([still, course.place[:steps]])
    speed = np.concatenate([np.zeros(settle), course.speed[:steps]])
    out = np.empty((len(place), len(SIGNALS)))
    _run(numbers, place, speed, settle + round(onset_s / STEP_S), faulty, out)
    blocks = out[settle:].reshape(-1, STEPS, len(SIGNALS))
    found = dict(zip(SIGNALS, blocks.mean(axis=1).T, strict=True))
    for name in ("place", "far_place", "degc"):
        found[name] = blocks[:, -1, SIGNALS.index(name)].copy()
    return found


def with_weight(numbers: Numbers, mass: float, arm: float) -> Numbers:
    """The same with so much more mass on the load side, at this arm; 0: it slides."""
    inertia = mass * (arm * arm if arm else 1.0)
    return numbers._replace(
        load_mass=numbers.load_mass + inertia,
        weight=numbers.weight + GRAVITY * mass * (arm if arm else 1.0),
    )


def sine(amplitude: float, rate_hz: float, centre: float, seconds: float) -> Course:
    """There and back, starting at rest in the centre by a soft ramp of the amplitude."""
    t = np.arange(round(seconds / STEP_S)) * STEP_S
    ramp = np.clip(t / 2.0, 0.0, 1.0)
    soft = ramp * ramp * (3.0 - 2.0 * ramp)
    place = centre + amplitude * soft * np.sin(2.0 * np.pi * rate_hz * t)
    return Course(place, np.gradient(place, STEP_S))


def steps(amplitude: float, rate_hz: float, centre: float, seconds: float, rise: float) -> Course:
    """Smooth moves between two places, with rests; ``rise``: share of a half period that moves."""
    t = np.arange(round(seconds / STEP_S)) * STEP_S
    half = np.mod(2.0 * rate_hz * t, 2.0)
    share = np.clip(np.mod(half, 1.0) / rise, 0.0, 1.0)
    soft = share**3 * (10.0 - 15.0 * share + 6.0 * share**2)
    place = centre + amplitude * np.where(half < 1.0, 2.0 * soft - 1.0, 1.0 - 2.0 * soft)
    return Course(place, np.gradient(place, STEP_S))


def scaled(numbers: Numbers, **shares: float) -> Numbers:
    """The same with some numbers multiplied."""
    return numbers._replace(**{n: getattr(numbers, n) * by for n, by in shares.items()})
