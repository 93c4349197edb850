"""How far a position has jumped from the parabola through the samples before.

Three successive samples are held against the parabola through the six before them; the
smallest of the three counts, and only if all agree in sign. A single outlier is no jump,
nor is a mass that stops dead at an end stop: what it can fall short by is taken off.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from flea_diag.core.smoothing import sliding

Array = npt.NDArray[np.float64]

HISTORY = 6
AHEAD = 3
LENGTH = HISTORY + AHEAD
"""Scans that the predictor looks at: the longest a jump stays in it."""
TRACE = 6
"""Scans from the one that shows a jump to the last whose noise it spoils."""


def _weights() -> Array:
    """Weights of the history in the prediction of each of the samples ahead."""
    steps = np.arange(LENGTH, dtype=float)
    powers = np.stack((np.ones_like(steps), steps, steps**2), axis=1)
    return np.asarray(powers[HISTORY:] @ np.linalg.pinv(powers[:HISTORY]))


WEIGHTS = _weights()


def position_jumps(positions: Array) -> Array:
    """Jump (m) that each sample completes; shape (m - ``LENGTH`` + 1, columns) of (m, columns).

    Zero where nothing has jumped, NaN where a sample is missing.
    """
    samples = sliding(positions, LENGTH)
    history = samples[:, :HISTORY]
    apart = samples[:, HISTORY:] - np.matmul(WEIGHTS, history)
    stop = AHEAD * np.abs(history[:, 1:] - history[:, :-1]).max(axis=1)
    low, high = apart.min(axis=1) - stop, apart.max(axis=1) + stop
    jumps: Array = np.maximum(low, 0.0) + np.minimum(high, 0.0)
    return jumps


def traced(jumps: Array) -> npt.NDArray[np.bool_]:
    """Which samples lie in the trace of a jump; shape (m - ``TRACE`` + 1, columns).

    A sample that cannot be judged counts as a jump.
    """
    found: npt.NDArray[np.bool_] = np.any(sliding(jumps != 0.0, TRACE), axis=1)
    return found
