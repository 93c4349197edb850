"""One scan of a weighted particle cloud, with numpy; ``particle_loops`` has it for numba.

Both take the same random bits and do the same arithmetic; they differ in the order of sums
alone, that is in the last bits. Particles are columns; sizes: n states, p channels, m inputs,
N particles, q sources of noise. Arguments of both:

x (n, N)       particles; f(x) = T x + B u moves them (T = 1, B = 0: they have been moved)
cloud (2, N)   log weights and weights, normalised; renewed in place
new (n, N)     the particles after this scan
y (p,), u (m,) measurement, NaN = not measured, and inputs, NaN counts as zero
flat           the matrices of ``pack``, end to end (step_numpy: their views by ``unpack``)
words          64-bit random words: the first makes a uniform number, the rest normal ones
table          65536 normal quantiles, see ``normal_table``
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

import numpy as np
import numpy.typing as npt

from flea_diag.core.normal_table import normal_numbers, uniform_number
from flea_diag.core.resampling import effective_sample_size, normalised, systematic

Array = npt.NDArray[np.float64]
Words = npt.NDArray[np.uint64]


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


def unpack(flat: Array, n: int, p: int, m: int) -> list[Array]:
    """The matrices of ``pack`` as views of its row; the last one is L'."""
    shapes = ((n, n), (n, n), (p, n), (p, n), (p, n), (n, m), (p, m), (p,), (p, p), (p, p))
    parts, at = [], 0
    for shape in shapes:
        size = math.prod(shape)
        parts.append(flat[at : at + size].reshape(shape))
        at += size
    return [*parts, flat[at:].reshape(-1, n)]


def step_numpy(
    x: Array,
    cloud: Array,
    new: Array,
    y: Array,
    u: Array,
    matrices: list[Array],
    words: Words,
    table: Array,
    threshold: float,
    result: Array,
) -> bool:
    """See the module; takes the matrices as ``unpack`` gives them."""
    n, count = x.shape
    p = len(y)
    T, keep, HT, GT, gain, B, drive, h, whitening, factor, spread = matrices
    measured = np.isfinite(y)
    if ((whitening.diagonal() != 0.0) != measured).any():
        return False
    given = np.where(np.isnan(u), 0.0, u)
    ahead = h + drive @ given
    held = B @ given
    d = np.where(measured, y - ahead, 0.0)
    error = (whitening @ d)[:, None] - GT @ x
    centre = error @ cloud[1]
    apart = error - centre[:, None]
    expected = (apart * cloud[1]) @ apart.T
    expected.flat[:: p + 1] += 1.0
    result[:p] = ahead + HT @ (x @ cloud[1])
    result[p : 2 * p] = y - result[:p]
    result[2 * p : 3 * p] = np.sqrt(((factor @ expected) * factor).sum(axis=1))
    result[-2] = centre @ np.linalg.solve(expected, centre)
    log_weights = cloud[0] - 0.5 * (error * error).sum(axis=0)
    cloud[1], log_sum = normalised(log_weights)
    if math.isfinite(log_sum):
        np.subtract(log_weights, log_sum, out=cloud[0])
        held += d @ gain
    else:
        # Nothing fits: keep the prediction rather than follow a measurement of any size.
        cloud[0] = -math.log(count)
        keep = T
        result[-2] = math.inf
    result[3 * p : 3 * p + n] = keep @ (x @ cloud[1]) + held
    result[-1] = ess = effective_sample_size(cloud[1])
    if ess < threshold:
        x = x[:, systematic(cloud[1], uniform_number(words))]
        cloud[0] = -math.log(count)
        cloud[1] = 1.0 / count
    np.matmul(keep, x, out=new)
    new += held[:, None]
    if len(spread):
        new += spread.T @ normal_numbers(words, table, (len(spread), count))
    return True
