"""Commanded position and load as functions of time, without jumps in speed where it matters."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import numpy.typing as npt

from flea_sim_driver.scenario import Load, Motion, Scenario

Array = npt.NDArray[np.float64]
TRIANGLE_ROUNDING = 0.995


def _sine(motion: Motion, time_s: Array, _duration: float) -> Array:
    return np.asarray(np.sin(2.0 * np.pi * motion.frequency_hz * time_s))


def _triangle(motion: Motion, time_s: Array, duration: float) -> Array:
    """A triangle whose corners are rounded: asin(k sin) with k just below 1."""
    sine = TRIANGLE_ROUNDING * _sine(motion, time_s, duration)
    return np.asarray(np.arcsin(sine) / np.arcsin(TRIANGLE_ROUNDING))


def _trapezoid(motion: Motion, time_s: Array, _duration: float) -> Array:
    """Holds joined by ramps of fifth order, which end without speed and acceleration."""
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
    load = _load(scenario.load, time_s)
    if scenario.flight is not None:
        position, flown = scenario.flight.at(time_s)
        return position, flown + load
    motion = scenario.motion
    shape = SHAPES[motion.kind](motion, time_s, scenario.run.duration_s)
    return motion.centre_m + motion.amplitude_m * shape, load


def _load(load: Load, time_s: Array) -> Array:
    wave = np.sin(2.0 * np.pi * load.frequency_hz * time_s)
    return np.asarray(load.constant_n + load.amplitude_n * wave)
