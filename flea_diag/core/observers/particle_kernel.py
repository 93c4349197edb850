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

"""One scan of a weighted particle cloud, with numpy; ``particle_loops`` has it for numba.

Both take the same random bits and do the same arithmetic; they differ in the order of sums
alone, that is in the last bits. Particles are columns; sizes: n states, p channels, m inputs,
N particles, q sources of noise. Arguments of both:

x (n, N)       particles; f(x) = T x + B u moves them (T = 1, B = 0: they have been moved)
cloud (2, N)   log weights and weights, normalised; renewed in place
new (n, N)     the particles after this scan
y (p,), u (m,) measurement, NaN = not measured, and inputs, NaN counts as zero
flat           the matrices of ``pack``, end to end (step_numpy: their views by ``unpack``)
uniform        a random number in [0, 1)
chosen         random indices into ``table``, at least q N
table          normal quantiles, see ``normal_table``
threshold      resample below this effective sample size
result         prediction (p), residual (p), sigma (p), posterior mean (n), NIS, ESS

They return whether ``flat`` is made for the channels that ``y`` measures; if not, nothing has
been done.

The optimal proposal (Doucet et al. 2000, section II.D): with S = H Q H' + R and
K = Q H' S^-1 the weight is N(y; H f(x) + h, S), which does not depend on the particle drawn,
so that resampling comes first; then x ~ N(f + K (y - h - H f), L L'), L L' = (1 - K H) Q.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from flea_diag.core.observers.normal_table import Indices, normal_numbers
from flea_diag.core.observers.resampling import effective_sample_size, normalised, systematic

Array = npt.NDArray[np.float64]


def pack(
    T: Array,
    B: Array,
    H: Array,
    drive: Array,
    h: Array,
    whitening: Array,
    factor: Array,
    gain: Array,
    spread: Array,
) -> Array:
    """All matrices of one pattern of measured channels in one row, as both functions read it.

    Parameters
    ----------
    T, B : shape (n, n), (n, m)
        Transition.
    H, drive, h : shape (p, n), (p, m), (p,)
        Measurement y = H x + h, and ``drive`` = H B + D: what inputs do to it at once.
    whitening, factor : shape (p, p)
        W with W S W' = 1 and its inverse, zero for what is not measured.
    gain, spread : shape (n, p), (n, q)
        K and L.
    """
    keep = np.eye(len(T)) - gain @ H
    parts = (T, keep @ T, H @ T, whitening @ H @ T, gain.T, B, drive, h, whitening, factor)
    return np.concatenate([np.ravel(part) for part in (*parts, spread.T)])


class Views(NamedTuple):
    """The matrices of ``pack`` as ``step_numpy`` takes them; what is used together is one."""

    T: Array
    keep: Array
    seen: Array
    """H T above G T, shape (2 p, n)."""
    gain: Array
    given: Array
    """B above H B + D, shape (n + p, m)."""
    h: Array
    whitening: Array
    factor: Array
    spread: Array
    measured: bytes


def unpack(flat: Array, n: int, p: int, m: int) -> Views:
    """Views of the row that ``pack`` makes."""
    shapes = ((n, n), (n, n), (2 * p, n), (p, n), (n + p, m), (p,), (p, p), (p, p))
    parts, at = [], 0
    for shape in shapes:
        size = math.prod(shape)
        parts.append(flat[at : at + size].reshape(shape))
        at += size
    T, keep, seen, gain, given, h, whitening, factor = parts
    spread, measured = flat[at:].reshape(-1, n), (whitening.diagonal() != 0.0).tobytes()
    return Views(T, keep, seen, gain, given, h, whitening, factor, spread, measured)


@np.errstate(over="ignore", invalid="ignore")  # what nothing fits is handled below
def step_numpy(
    x: Array,
    cloud: Array,
    new: Array,
    y: Array,
    u: Array,
    matrices: Views,
    uniform: float,
    chosen: Indices,
    table: Array,
    threshold: float,
    result: Array,
) -> bool:
    """See the module; takes the matrices as ``unpack`` gives them."""
    n, count = x.shape
    p = len(y)
    T, keep, seen, gain, given, h, whitening, factor, spread, pattern = matrices
    measured = np.isfinite(y)
    if measured.tobytes() != pattern:
        return False
    if math.isnan(u @ u):
        u = np.nan_to_num(u)
    added = given @ u
    held, ahead = added[:n], added[n:] + h
    d = np.where(measured, y - ahead, 0.0)
    weights = cloud[1]
    middle = seen @ (x @ weights)
    error, centre, expected = whitened(x, weights, whitening @ d, seen[p:], middle[p:])
    ahead += middle[:p]
    result[:p] = ahead
    np.subtract(y, ahead, out=result[p : 2 * p])
    result[2 * p : 3 * p] = np.sqrt(((factor @ expected) * factor).sum(axis=1))
    result[-2] = squared_length(expected.tolist(), centre.tolist())
    error *= error
    log_weights = error.sum(axis=0)
    log_weights *= -0.5
    log_weights += cloud[0]
    weights, log_sum = normalised(log_weights)
    if math.isfinite(log_sum):
        log_weights -= log_sum
        held += d @ gain
    else:
        # Nothing fits: keep the prediction rather than follow a measurement of any size.
        log_weights[:] = -math.log(count)
        keep = T
        result[-2] = math.inf
    result[3 * p : 3 * p + n] = keep @ (x @ weights) + held
    result[-1] = ess = effective_sample_size(weights)
    if ess < threshold:
        x = x.take(systematic(weights, uniform), axis=1)
        cloud[0] = -math.log(count)
        cloud[1] = 1.0 / count
    else:
        cloud[0], cloud[1] = log_weights, weights
    np.matmul(keep, x, out=new)
    new += held[:, None]
    if len(spread):
        new += spread.T @ normal_numbers(chosen, table, (len(spread), count))
    return True


def whitened(
    x: Array, weights: Array, start: Array, seen: Array, middle: Array
) -> tuple[Array, Array, Array]:
    """Whitened errors of all particles, their weighted mean and the innovation's covariance.

    Parameters
    ----------
    start : shape (p,)
        W d, the whitened part of the error that all particles share.
    seen, middle : shape (p, n), (p,)
        G T, and G T times the weighted mean of the particles.

    Returns
    -------
    error, centre, expected : shape (p, N), (p,), (p, p)
        ``expected`` is the covariance of ``error`` plus one, that of the whitened noise.
    """
    centre = start - middle
    error = start[:, None] - seen @ x
    apart = error - centre[:, None]
    expected = (apart * weights) @ apart.T
    expected.flat[:: len(start) + 1] += 1.0
    return error, centre, expected


def squared_length(covariance: list[list[float]], vector: list[float]) -> float:
    """Of v in the metric of C, v' C^-1 v, by Cholesky's factor, in place.

    For a few numbers this is faster than any library.
    """
    total = 0.0
    for a, row in enumerate(covariance):
        s = vector[a]
        for b in range(a):
            above = covariance[b]
            row[b] = (row[b] - sum(row[c] * above[c] for c in range(b))) / above[b]
            s -= row[b] * vector[b]
        pivot = row[a] - sum(row[c] * row[c] for c in range(a))
        if not pivot > 0.0:
            return math.nan
        row[a] = math.sqrt(pivot)
        vector[a] = s / row[a]
        total += vector[a] * vector[a]
    return total
