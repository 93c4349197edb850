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

"""Commanded position and load over time, continuous in position, speed and acceleration."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
import numpy.typing as npt

from flea_sim_driver.scenario.holding import motion_time
from flea_sim_driver.scenario.scenario import Scenario
from flea_sim_driver.scenario.settings import Load, Motion

Array = npt.NDArray[np.float64]
TRIANGLE_ROUNDING = 0.995
RAMP_PEAKS = (2.0 * 1.875, 2.0 * 10.0 / 3.0**0.5, 2.0 * 60.0)
"""Largest derivatives of a fifth-order ramp from -1 to 1 in 1 s."""
PERIODIC = {"sine": "sine", "triangle": "triangle", "sweep": "sine"}
"""Kinds whose peaks are those of a periodic shape."""


def _sine(motion: Motion, time_s: Array, _duration: float) -> Array:
    return np.asarray(np.sin(2.0 * np.pi * motion.frequency_hz * time_s))


def _triangle(motion: Motion, time_s: Array, duration: float) -> Array:
    """A triangle whose corners are rounded: asin(k sin) with k just below 1."""
    sine = TRIANGLE_ROUNDING * _sine(motion, time_s, duration)
    return np.asarray(np.arcsin(sine) / np.arcsin(TRIANGLE_ROUNDING))


def _trapezoid(motion: Motion, time_s: Array, _duration: float) -> Array:
    """Holds joined by fifth-order ramps, which end with zero speed and acceleration."""
    period = 1.0 / motion.frequency_hz
    within = np.mod(time_s, period)
    up = np.clip(within / motion.rise_s, 0.0, 1.0)
    down = np.clip((within - 0.5 * period) / motion.rise_s, 0.0, 1.0)
    return np.asarray(2.0 * (_smooth(up) - _smooth(down)) - 1.0)


def _smooth(u: Array) -> Array:
    return u**3 * (10.0 - 15.0 * u + 6.0 * u**2)


def _sweep(motion: Motion, time_s: Array, duration: float) -> Array:
    """Linear sine sweep from ``frequency_hz`` to ``end_frequency_hz`` over the run."""
    rate = (motion.end_frequency_hz - motion.frequency_hz) / duration
    phase = 2.0 * np.pi * (motion.frequency_hz * time_s + 0.5 * rate * time_s**2)
    return np.asarray(np.sin(phase))


def _hold(_motion: Motion, time_s: Array, _duration: float) -> Array:
    return np.zeros_like(time_s)


SHAPES: dict[str, Callable[[Motion, Array, float], Array]] = {
    "sine": _sine,
    "triangle": _triangle,
    "trapezoid": _trapezoid,
    "sweep": _sweep,
    "hold": _hold,
}


def commanded(scenario: Scenario, time_s: Array) -> tuple[Array, Array]:
    """Commanded position in m and load in N at times in s after the start, shapes (n,)."""
    motion = scenario.motion
    real_s, time_s = time_s, motion_time(scenario.brake, time_s)
    swell = _smooth(np.clip(time_s / motion.start_s, 0.0, 1.0))
    load = swell * _load(scenario.load, real_s)
    if scenario.flight is not None:
        position, flown = scenario.flight.at(time_s)
        return position, flown + load
    if motion.kind != "trapezoid":  # which starts from a hold of its own
        swell = motion.amplitude_m * swell
    else:
        swell = np.full_like(time_s, motion.amplitude_m)
    shape = SHAPES[motion.kind](motion, time_s, scenario.run.duration_s)
    return motion.centre_m + swell * shape, load


def _load(load: Load, time_s: Array) -> Array:
    wave = np.sin(2.0 * np.pi * load.frequency_hz * time_s)
    return np.asarray(load.constant_n + load.amplitude_n * wave)


@dataclass(frozen=True)
class Peaks:
    """Greatest speed in m/s, acceleration in m/s^2 and jerk in m/s^3 of a command."""

    speed_m_s: float
    acceleration_m_s2: float
    jerk_m_s3: float


def peaks(motion: Motion) -> Peaks:
    """Peaks of the motion at full amplitude; of a sweep at its highest frequency."""
    if motion.kind == "trapezoid":
        scale, speed, acceleration, jerk = 1.0 / motion.rise_s, *RAMP_PEAKS
    elif motion.kind in PERIODIC:
        sweep = motion.kind == "sweep"
        fastest = max(motion.frequency_hz, motion.end_frequency_hz if sweep else 0.0)
        scale, (speed, acceleration, jerk) = fastest, _shape_peaks(PERIODIC[motion.kind])
    else:
        return Peaks(0.0, 0.0, 0.0)
    amplitude = motion.amplitude_m
    return Peaks(
        amplitude * speed * scale, amplitude * acceleration * scale**2, amplitude * jerk * scale**3
    )


@lru_cache(maxsize=4)
def _shape_peaks(kind: str) -> tuple[float, float, float]:
    """Peaks of one period of 1 s and amplitude 1 m, by differences on a fine grid."""
    step = 1e-4
    time = np.arange(0.0, 1.5, step)
    shape = SHAPES[kind](Motion(kind=kind, frequency_hz=1.0), time, 1.0)
    first, second, third = (np.abs(np.diff(shape, n)).max() / step**n for n in (1, 2, 3))
    return float(first), float(second), float(third)
