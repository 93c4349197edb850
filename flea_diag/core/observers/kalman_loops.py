"""Many scans of the Kalman filter in one compiled call: the driven model and its temperatures.

For numba, as ``track_loops``. Readings correct one after another, which for independent noise is
the same as all at once and inverts no matrix. What is finite is below infinity:
``math.isfinite`` subtracts a number from itself, which sums that may be reordered make 0.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from flea_diag.core.observers.motion_step import MotionCoefficients, motion_step
from flea_diag.core.observers.particle_kernel import Array
from flea_diag.core.observers.thermal_filter import ESTIMATE, heat_loops
from flea_diag.core.observers.track_loops import LOST, WARMED, supplies

STEP = 1e-6
"""Step of the central differences, of a state or of 1: as ``driven_model.central_differences``."""


def sandwich_loops(A: Array, P: Array, spare: Array) -> None:
    """P becomes A P A'."""
    n = len(A)
    for i in range(n):
        for j in range(n):
            total = 0.0
            for k in range(n):
                total += A[i, k] * P[k, j]
            spare[i, j] = total
    for i in range(n):
        for j in range(n):
            total = 0.0
            for k in range(n):
                total += spare[i, k] * A[j, k]
            P[i, j] = total


def correct_loops(
    x: Array, P: Array, y: Array, H: Array, h: Array, r: Array, spare: tuple[Array, Array, Array]
) -> float:
    """Correct by what was measured; the normalised innovation squared, NaN of no covariance."""
    keep, gain, room = spare
    nis, n = 0.0, len(x)
    for c in range(len(y)):
        residual, variance = y[c] - h[c], r[c]
        for i in range(n):
            residual -= H[c, i] * x[i]
            gain[i] = 0.0
            for j in range(n):
                gain[i] += P[i, j] * H[c, j]
            variance += H[c, i] * gain[i]
        if not abs(residual) < math.inf:
            continue
        if not variance > 0.0:
            return math.nan
        nis += residual * residual / variance
        for i in range(n):
            gain[i] /= variance
            x[i] += gain[i] * residual
            for j in range(n):
                keep[i, j] = (1.0 if i == j else 0.0) - gain[i] * H[c, j]
        # Joseph's form: remains a covariance in spite of rounding.
        sandwich_loops(keep, P, room)
        for i in range(n):
            for j in range(n):
                P[i, j] += r[c] * gain[i] * gain[j]
    return nis


def compare_loops(x: Array, P: Array, y: Array, H: Array, h: Array, r: Array, told: Array) -> None:
    """Prediction, residual and sigma of each channel."""
    p, n = H.shape
    for c in range(p):
        told[c], variance = h[c], r[c]
        for i in range(n):
            told[c] += H[c, i] * x[i]
            for j in range(n):
                variance += H[c, i] * P[i, j] * H[c, j]
        told[p + c] = y[c] - told[c]
        told[2 * p + c] = math.sqrt(variance) if abs(told[p + c]) < math.inf else 0.0


def advance_loops(
    x: Array, P: Array, u: Array, Q: Array, motion: tuple[bool, MotionCoefficients, Any],
    tried: Array, moved: Array, spare: tuple[Array, Array, Array],
) -> None:  # fmt: skip
    """One period on, linearised where the state is."""
    pwm, coefficients, parameters = motion
    slopes, steps, room = spare
    n = len(x)
    for i in range(n):
        steps[i] = STEP * max(1.0, abs(x[i]))
        for j in range(2 * n + 1):
            tried[i, j] = x[i]
        tried[i, 1 + i] += steps[i]
        tried[i, n + 1 + i] -= steps[i]
    motion_step(tried, u, pwm, coefficients, parameters, moved)
    for i in range(n):
        x[i] = moved[i, 0]
        for j in range(n):
            slopes[i, j] = (moved[i, 1 + j] - moved[i, n + 1 + j]) / (2.0 * steps[j])
    sandwich_loops(slopes, P, room)
    for i in range(n):
        for j in range(n):
            P[i, j] += Q[i, j]


def kalman_loops(
    x: Array, P: Array, scans: tuple[Array, Array, Array, Array], first: int, last: int,
    model: tuple[Array, Array, Array, Array], motion: tuple[bool, MotionCoefficients, Any],
    heat: tuple[Array, tuple[int, float, float]], frozen: bool, begun: bool, out: Array,
) -> tuple[int, int]:  # fmt: skip
    """Scans from ``first`` to before ``last`` until one ends it; see ``track_loops``.

    ``model`` is what reads the states, offsets, variances of readings, and the process noise by
    which inputs are measured. Mean, covariance and stores are renewed in place.
    """
    U, Y, held, readings = scans
    H, h, r, noises = model
    stores, (winding, degc, warmed) = heat
    p, n = H.shape
    at = 3 * p + n + 2
    tried, moved = np.empty((n, 2 * n + 1)), np.empty((n, 2 * n + 1))
    spare = np.empty((n, n)), np.empty(n), np.empty((n, n))
    near, apart = np.empty(n), np.empty((n, n))
    for k in range(first, last):
        u, told = U[k], out[k, :at]
        if not begun:
            Q = noises[int(not math.isnan(u[0])), int(not math.isnan(u[1]))]
            advance_loops(x, P, u, Q, motion, tried, moved, spare)
        compare_loops(x, P, Y[k], H, h, r, told)
        near[:], apart[:, :] = x, P
        nis = correct_loops(near, apart, Y[k], H, h, r, spare)
        sane = abs(nis) < math.inf
        if frozen and sane:
            # Compared with all, moved by what drives it alone.
            near[:], apart[:, :] = x, P
            correct_loops(near, apart, held[k], H, h, r, spare)
        if sane:
            x[:], P[:, :] = near, apart
        told[3 * p : at - 2] = x
        told[at - 2], told[at - 1] = nis, math.inf
        flows = supplies(motion[2][0], (x[0], x[1], degc))
        for j in range(len(stores)):
            end = at + 4 * (j + 1)
            heat_loops(stores[j], readings[k], j, flows[j], frozen, out[k, end - 4 : end])
        end = 0 if frozen or sane else LOST
        if winding >= 0 and abs(stores[winding, ESTIMATE] - degc) > warmed:
            end |= WARMED
        if end:
            return k + 1 - first, end
    return last - first, 0


KALMAN = (sandwich_loops, correct_loops, compare_loops, advance_loops, heat_loops)
"""What ``kalman_loops`` calls beside the step of a set of relations."""
