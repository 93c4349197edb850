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

"""``particle_kernel.step_numpy`` as loops, for numba to compile.

These functions call nothing but each other, because this package runs without numba too. Read
``step_numpy`` first; the steps come in its order. Loops over particles are innermost, so that
they vectorise.

Parts take the row of matrices with offsets into it, not views: of views, LLVM vectorises the
sums over states and channels too, whose last bits would then depend on the width of vectors.
"""

from __future__ import annotations

import math

import numpy as np

from flea_diag.core.observers.normal_table import Indices
from flea_diag.core.observers.particle_kernel import Array
from flea_diag.core.observers.resampling_loops import (
    exp_loops,
    likelihood_loops,
    mean_loops,
    normalisation_loops,
    resampling_loops,
)


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
    p = len(y)
    log_weights, weights = cloud[0], cloud[1]
    T, keep, HT, GT, gain, B, drive, h, whitening, factor, spread = offsets(n, p, len(u))
    for a in range(p):
        if math.isfinite(y[a]) != (flat[whitening + a * p + a] != 0.0):
            return False
    error = np.empty((p + 1 + n, count))
    fit, noise = error[p], error[p + 1 :]
    small = np.zeros(2 * n + 2 * p + p * p)
    held, middle = small[:n], small[n : 2 * n]
    d, centre = small[2 * n : 2 * n + p], small[2 * n + p : 2 * n + 2 * p]
    expected = small[2 * n + 2 * p :].reshape(p, p)

    mean_loops(x, weights, middle)
    input_loops(flat, B, u, held)
    prediction_loops(flat, HT, drive, h, middle, u, y, d, result)
    whitening_loops(x, weights, flat, GT, whitening, d, error, fit, centre, expected)
    sigma_loops(flat, factor, expected, result[2 * p : 3 * p])
    nis = nis_loops(expected, centre)

    largest = likelihood_loops(log_weights, weights, fit)
    # In a part of their own these sums come out otherwise in the last bits.
    total, squares = 0.0, 0.0
    for i in range(count):
        total += weights[i]
        squares += weights[i] * weights[i]
    normalisation_loops(log_weights, weights, largest, total)
    ess = total * total / squares
    good = math.isfinite(largest)
    result[3 * p + n] = nis if good else math.inf
    result[3 * p + n + 1] = ess
    if good:
        correction_loops(flat, gain, d, held)
    else:
        keep = T
    mean_loops(x, weights, middle)
    for a in range(n):
        s = held[a]
        for c in range(n):
            s += flat[keep + a * n + c] * middle[c]
        result[3 * p + a] = s

    source = resampling_loops(x, log_weights, weights, uniform) if ess < threshold else x
    draw_loops(source, flat, keep, held, spread, chosen, table, noise, new)
    return True


def offsets(n: int, p: int, m: int) -> tuple[int, ...]:
    """Where ``pack`` puts T, keep, H T, G T, K', B, drive, h, W, factor and L'."""
    keep = n * n
    HT = keep + n * n
    GT = HT + p * n
    gain = GT + p * n
    B = gain + p * n
    drive = B + n * m
    h = drive + p * m
    whitening = h + p
    factor = whitening + p * p
    spread = factor + p * p
    return 0, keep, HT, GT, gain, B, drive, h, whitening, factor, spread


def input_loops(flat: Array, B: int, u: Array, held: Array) -> None:
    """Add B u, what the inputs do to all particles; a missing input counts as zero."""
    n, m = len(held), len(u)
    for c in range(n):
        for b in range(m):
            if not math.isnan(u[b]):
                held[c] += flat[B + c * m + b] * u[b]


def prediction_loops(
    flat: Array,
    HT: int,
    drive: int,
    h: int,
    mean: Array,
    u: Array,
    y: Array,
    d: Array,
    result: Array,
) -> None:
    """Prediction and residual of each channel; d = y - h - drive u, where measured."""
    n, p, m = len(mean), len(y), len(u)
    for a in range(p):
        ahead = flat[h + a]
        for b in range(m):
            if not math.isnan(u[b]):
                ahead += flat[drive + a * m + b] * u[b]
        if math.isfinite(y[a]):
            d[a] = y[a] - ahead
        for c in range(n):
            ahead += flat[HT + a * n + c] * mean[c]
        result[a] = ahead
        result[p + a] = y[a] - ahead


def whitening_loops(
    x: Array,
    weights: Array,
    flat: Array,
    GT: int,
    whitening: int,
    d: Array,
    error: Array,
    fit: Array,
    centre: Array,
    expected: Array,
) -> None:
    """Whitened errors of all particles, their squares' sum, weighted mean and covariance.

    ``expected`` is this covariance plus one, the covariance of the whitened innovation.
    """
    n, p, count = len(x), len(d), len(weights)
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


def sigma_loops(flat: Array, factor: int, expected: Array, sigma: Array) -> None:
    """Standard deviation of each channel's residual."""
    p = len(sigma)
    for a in range(p):
        s = 0.0
        for b in range(a + 1):
            for c in range(a + 1):
                s += flat[factor + a * p + b] * expected[b, c] * flat[factor + a * p + c]
        sigma[a] = math.sqrt(s)


def nis_loops(expected: Array, centre: Array) -> float:
    """NIS = |C^-1 centre|^2 by way of Cholesky's factor C of ``expected``, both in place."""
    nis = 0.0
    for a in range(len(centre)):
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
    return nis


def correction_loops(flat: Array, gain: int, d: Array, held: Array) -> None:
    """Add K d, what the measurement does to all particles."""
    n, p = len(held), len(d)
    for a in range(p):
        for c in range(n):
            held[c] += flat[gain + a * n + c] * d[a]


def draw_loops(
    source: Array,
    flat: Array,
    keep: int,
    held: Array,
    spread: int,
    chosen: Indices,
    table: Array,
    noise: Array,
    new: Array,
) -> None:
    """The particles after this scan: what is common to all, their own part, and noise L e."""
    n, count = source.shape
    q = (len(flat) - spread) // n
    for b in range(q):
        for i in range(count):
            noise[b, i] = table[chosen[b * count + i]]
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
                    row[i] += wide * noise[b, i]


STEP = (
    step_loops,
    offsets,
    input_loops,
    prediction_loops,
    whitening_loops,
    sigma_loops,
    nis_loops,
    likelihood_loops,
    normalisation_loops,
    correction_loops,
    mean_loops,
    resampling_loops,
    draw_loops,
    exp_loops,
)
"""What ``backend.compiled`` takes: the function, and what it calls."""
