"""``particle_kernel.step_numpy`` as loops, for numba to compile.

These functions call nothing but each other, because this package runs without numba too. Read
``step_numpy`` first; the sections come in its order. Loops over particles are innermost, so that
they vectorise.
"""

from __future__ import annotations

import math

import numpy as np

from flea_diag.core.observers.normal_table import Indices
from flea_diag.core.observers.particle_kernel import Array

LN2 = math.log(2.0)
INVERSE_LN2 = 1.0 / LN2
INVERSE_FACTORIALS = tuple(1.0 / math.factorial(k) for k in range(13))


def exp_loops(v: Array, found: Array) -> None:
    """Exponentials of ``v``, -700 or more and not positive, which is used up.

    exp(v) = 2^k exp(r), |r| <= ln(2)/2, by Taylor's series to the last bit: this vectorises, a
    call of exp() does not.
    """
    power = np.empty(len(v), np.int64)
    scale = power.view(np.float64)
    for i in range(len(v)):
        k = math.floor(v[i] * INVERSE_LN2 + 0.5)
        v[i] -= k * LN2
        power[i] = (np.int64(k) + 1023) << 52
        found[i] = 1.0 / 6227020800.0
    for degree in range(13, 0, -1):
        inverse = INVERSE_FACTORIALS[degree - 1]
        for i in range(len(v)):
            found[i] = found[i] * v[i] + inverse
    for i in range(len(v)):
        found[i] *= scale[i]


def step_loops(
    x: Array,
    cloud: Array,
    new: Array,
    y: Array,
    u: Array,
    flat: Array,
    uniform: float,
    chosen: Indices,
    table: Array,
    threshold: float,
    result: Array,
) -> bool:
    """One scan; arguments as in ``particle_kernel``, matrices as ``pack`` puts them."""
    n, count = x.shape
    p, m = len(y), len(u)
    log_weights, weights = cloud[0], cloud[1]
    # Where pack() put what: T, keep, H T, G T, K', B, drive, h, W, factor, L'.
    T, keep = 0, n * n
    HT = 2 * n * n
    GT = HT + p * n
    gain = GT + p * n
    B = gain + p * n
    drive = B + n * m
    h = drive + p * m
    whitening = h + p
    factor = whitening + p * p
    spread = factor + p * p
    q = (len(flat) - spread) // n
    for a in range(p):
        if math.isfinite(y[a]) != (flat[whitening + a * p + a] != 0.0):
            return False

    # Prediction of every channel; what the inputs and the measurement add to all particles.
    error = np.empty((p + 1 + max(q, 1), count))
    small = np.zeros(2 * n + 2 * p + p * p)
    held, middle = small[:n], small[n : 2 * n]
    d, centre = small[2 * n : 2 * n + p], small[2 * n + p : 2 * n + 2 * p]
    expected = small[2 * n + 2 * p :].reshape(p, p)
    for c in range(n):
        s = 0.0
        for i in range(count):
            s += x[c, i] * weights[i]
        middle[c] = s
        for b in range(m):
            if not math.isnan(u[b]):
                held[c] += flat[B + c * m + b] * u[b]
    for a in range(p):
        ahead = flat[h + a]
        for b in range(m):
            if not math.isnan(u[b]):
                ahead += flat[drive + a * m + b] * u[b]
        if math.isfinite(y[a]):
            d[a] = y[a] - ahead
        for c in range(n):
            ahead += flat[HT + a * n + c] * middle[c]
        result[a] = ahead
        result[p + a] = y[a] - ahead

    # Whitened errors of all particles, their weighted mean and covariance, their fit.
    fit = error[p]
    fit[:] = 0.0
    for a in range(p):
        if flat[whitening + a * p + a] == 0.0:
            continue
        row = error[a]
        start = 0.0
        for b in range(p):
            start += flat[whitening + a * p + b] * d[b]
        row[:] = start
        for c in range(n):
            g = flat[GT + a * n + c]
            if g != 0.0:
                for i in range(count):
                    row[i] -= g * x[c, i]
        s = 0.0
        for i in range(count):
            s += row[i] * weights[i]
            fit[i] += row[i] * row[i]
        centre[a] = s
        for b in range(a):
            if flat[whitening + b * p + b] != 0.0:
                s = 0.0
                for i in range(count):
                    s += row[i] * (error[b, i] - centre[b]) * weights[i]
                expected[a, b] = expected[b, a] = s
        s = 0.0
        for i in range(count):
            s += (row[i] - centre[a]) * (row[i] - centre[a]) * weights[i]
        expected[a, a] = s
    for a in range(p):
        expected[a, a] += 1.0
    for a in range(p):
        s = 0.0
        for b in range(a + 1):
            for c in range(a + 1):
                s += flat[factor + a * p + b] * expected[b, c] * flat[factor + a * p + c]
        result[2 * p + a] = math.sqrt(s)
    # NIS = |C^-1 centre|^2 by way of Cholesky's factor C of what is expected, in place.
    nis = 0.0
    for a in range(p):
        for b in range(a + 1):
            s = expected[a, b]
            for c in range(b):
                s -= expected[a, c] * expected[b, c]
            expected[a, b] = math.sqrt(s) if a == b else s / expected[b, b]
        s = centre[a]
        for c in range(a):
            s -= expected[a, c] * centre[c]
        centre[a] = s / expected[a, a]
        nis += centre[a] * centre[a]

    # Weights by way of their logarithms.
    largest = -math.inf
    for i in range(count):
        log_weights[i] -= 0.5 * fit[i]
        if log_weights[i] > largest:
            largest = log_weights[i]
    good = math.isfinite(largest)
    for i in range(count):
        v = log_weights[i] - largest if good else 0.0
        fit[i] = v if v > -700.0 else -700.0  # below e^-700, or NaN, counts as nothing
    exp_loops(fit, weights)
    total, squares = 0.0, 0.0
    for i in range(count):
        total += weights[i]
        squares += weights[i] * weights[i]
    ess = total * total / squares
    lost = largest + math.log(total) if good else 0.0
    share = 1.0 / total
    for i in range(count):
        weights[i] *= share
        log_weights[i] = log_weights[i] - lost if good else -math.log(count)
    result[3 * p + n] = nis if good else math.inf
    result[3 * p + n + 1] = ess
    if good:
        for a in range(p):
            for c in range(n):
                held[c] += flat[gain + a * n + c] * d[a]
    else:
        keep = T
    for c in range(n):
        s = 0.0
        for i in range(count):
            s += x[c, i] * weights[i]
        middle[c] = s
    for a in range(n):
        s = held[a]
        for c in range(n):
            s += flat[keep + a * n + c] * middle[c]
        result[3 * p + a] = s

    source = x
    if ess < threshold:
        # How many particles have all their copies before place k: the index of the one at k.
        done = np.zeros(count + 1, np.int64)
        reached = 0.0
        for i in range(count - 1):
            reached += weights[i] * count
            done[min(count, math.ceil(reached - uniform))] += 1
        source = np.empty((n, count))
        index = 0
        for k in range(count):
            index += done[k]
            done[k] = index
        for c in range(n):
            for k in range(count):
                source[c, k] = x[c, done[k]]
        weights[:] = 1.0 / count
        log_weights[:] = -math.log(count)

    for b in range(q):
        row = error[p + 1 + b]
        for i in range(count):
            row[i] = table[chosen[b * count + i]]
    for a in range(n):
        row = new[a]
        row[:] = held[a]
        for c in range(n):
            kept = flat[keep + a * n + c]
            if kept != 0.0:
                for i in range(count):
                    row[i] += kept * source[c, i]
        for b in range(q):
            wide = flat[spread + b * n + a]
            if wide != 0.0:
                for i in range(count):
                    row[i] += wide * error[p + 1 + b, i]
    return True


STEP = (step_loops, exp_loops)
"""What ``backend.compiled`` takes: the function, and what it calls."""
