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

"""One causal FIR kernel for value, first and second derivative of every slow channel.

A linear relation between signals (Kirchhoff, Newton) still holds between the same signals
seen through one common linear filter. So parity relations are evaluated on signals
that are all smoothed by this kernel, and no term leads another. It also averages a voltage that
was sampled as raw PWM. The cost is a delay of half the kernel.

Where readings are missing, the kernel is laid over the smoothest curve through those that were
read: that of the least second differences. This is linear in the readings, so a gap has a kernel of
its own, and that kernel says by how much noise is amplified.
"""

from __future__ import annotations

import math
from functools import lru_cache
from typing import Any

import numpy as np
import numpy.typing as npt

from flea_diag.core.row_ring import RowRing

Array = npt.NDArray[np.float64]
Flags = npt.NDArray[np.bool_]

MOST_NOISE = 2.0
"""Noise of a smoothed value, in times that without a gap, beyond which it has no value."""


def hann_kernels(length: int, period_s: float) -> Array:
    """Value, first and second derivative kernels, shape (3, length), for use as ``k @ window``.

    A raised cosine and its derivatives, scaled so that a constant, a ramp and a parabola
    come out exactly at the kernel's centre.
    """
    if length < 5 or length % 2 == 0:
        raise ValueError(f"kernel length {length} must be odd and at least 5")
    steps = np.arange(length) - (length - 1) / 2
    phase = 2.0 * np.pi * steps / (length + 1)
    value = 1.0 + np.cos(phase)
    value /= value.sum()
    first = np.sin(phase)
    first /= (first * steps).sum() * period_s
    second = -np.cos(phase)
    # The constant part must vanish, or a far-away position would read as an acceleration.
    second -= second.mean()
    second /= (second * steps**2).sum() * period_s**2 / 2.0
    return np.stack((value, first, second))


@lru_cache(maxsize=8)
def _whole(length: int, period_s: float) -> tuple[Array, Array]:
    """Kernels without a gap, and the sum of squared second differences as a quadratic form."""
    bends = np.diff(np.eye(length), 2, axis=0)
    return hann_kernels(length, period_s), bends.T @ bends


@lru_cache(maxsize=65536)
def gap_kernels(missing: bytes, period_s: float) -> tuple[Array, Array]:
    """The kernels of one pattern of missing readings, and the noise that they let through.

    ``missing`` are the flags of a window, a byte each. A kernel reads nothing where one is set. The
    kernels have shape (3, length); the noise, shape (3,), is the standard deviation of each result
    in times that of ``hann_kernels``, for readings whose noise is white; NaN kernels where it is
    above ``MOST_NOISE``.
    """
    lost = np.frombuffer(missing, dtype=bool)
    whole, bends = _whole(len(lost), period_s)
    # What a lost reading would have weighed goes to those that its place on the curve rests on.
    moved = np.linalg.solve(bends[np.ix_(lost, lost)], whole[:, lost].T).T
    kernels = whole - moved @ bends[lost]
    kernels[:, lost] = 0.0
    noise = np.sqrt(np.square(kernels).sum(axis=1) / np.square(whole).sum(axis=1))
    if noise.max() > MOST_NOISE:
        kernels[:] = np.nan
    return kernels, noise


class Smoother:
    """Smoothed values and derivatives of several channels, and the noise that gaps add to them.

    A missing reading (NaN) concerns its own channel alone. It is bridged while the noise stays
    below ``MOST_NOISE``; from then on that channel is NaN. What lies before the first row is no
    gap, nor is a reading that was refused: those beside it do not say what it should have been.
    """

    def __init__(self, channels: int, length: int, period_s: float) -> None:
        self._kernels = hann_kernels(length, period_s)
        self._length, self._period_s = length, period_s
        self._wait, self._refused_for = length - 1, 0
        self._rows = RowRing(channels, (length,))
        self._rows.store[:] = np.nan

    def push(self, rows: Array, refused: Flags | None = None) -> tuple[Array, Array | None]:
        """Take rows, shape (n, channels), with n = 1 live and many in a replay.

        ``refused``, of the same shape, is where a reading is NaN since it is not to be used.

        Returns
        -------
        derivatives : shape (n, 3, channels), each at its delayed centre
        noise : of the same shape, standard deviation in times that without gaps; None: 1
        """
        if len(rows) == 1 and refused is None and not (self._wait or self._refused_for):
            window = self._kept(rows)
            smooth = np.matmul(self._kernels, window[None])
            if not math.isnan(sum(smooth[0, 0].tolist())):
                return smooth, None
            return smooth, bridge(window, smooth, self._period_s)
        if refused is not None and refused.any():
            rows, self._refused_for = np.where(refused, np.inf, rows), len(rows) + self._length
        recent = np.concatenate((self._rows.last(self._length - 1), rows))
        self._kept(recent[-self._length :])
        known = np.where(np.isinf(recent), np.nan, recent) if self._refused_for else recent
        self._refused_for = max(self._refused_for - len(rows), 0)
        # One product of the same shape for each row, whatever n is: the same last bits.
        smooth = np.matmul(self._kernels, sliding(known, self._length))
        wait, self._wait = self._wait, max(self._wait - len(rows), 0)
        return smooth, bridge(recent, smooth, self._period_s, wait)

    def _kept(self, rows: Array) -> Array:
        """Keep some rows; a window up to the last of them."""
        at = self._rows.place(len(rows))
        end = at + len(rows)
        self._rows.store[at:end] = rows
        return self._rows.store[end - self._length : end]

    def clear(self) -> None:
        """Clear the window; the next ``length - 1`` results are NaN."""
        self._rows.last(self._length)[:] = np.nan
        self._wait = self._length - 1


def bridge(recent: Array, smooth: Array, period_s: float, skip: int = 0) -> Array | None:
    """Fill in what a few missing readings have made NaN; the noise of all, None where it is 1.

    ``recent``, shape (length - 1 + n, channels), are the readings, ``smooth``, shape (n, 3,
    channels), what the whole kernel makes of them; the first ``skip`` results stay as they are, and
    those over an infinite reading.
    """
    if not np.isnan(smooth[skip:, 0]).any():
        return None
    missing = np.isnan(recent)
    length = len(recent) - len(smooth) + 1
    gaps = sliding(missing, length)
    barred = np.asarray(sliding(np.isinf(recent), length).any(axis=1))
    noise: Array | None = None
    made: dict[bytes, tuple[Array, Array]] = {}
    for channel in np.flatnonzero(missing.any(axis=0) & ~missing.all(axis=0)):
        windows = gaps[:, :, channel]
        lost = np.where(barred[:, channel], 0, np.count_nonzero(windows, axis=1))[skip:]
        few = skip + np.flatnonzero((lost > 0) & (lost < length - 1))
        if not len(few):
            continue
        patterns = np.ascontiguousarray(windows[few])
        key = patterns.tobytes()  # a lost scan is one of all channels
        kernels, amplified = made[key] = made.get(key) or _kernels_of(patterns, period_s)
        readings = np.where(patterns, 0.0, sliding(recent, length)[few, :, channel])
        # A product for each row, as of one alone: the same last bits.
        smooth[few, :, channel] = np.matmul(kernels, readings[..., None])[..., 0]
        if noise is None:
            noise = np.ones_like(smooth)
        noise[few, :, channel] = amplified
    return noise


def _kernels_of(patterns: Flags, period_s: float) -> tuple[Array, Array]:
    """Kernels of several patterns, shape (n, 3, length), and noise, (n, 3); see ``gap_kernels``."""
    found = [gap_kernels(pattern.tobytes(), period_s) for pattern in patterns]
    kernels, noise = (np.stack(every) for every in zip(*found, strict=True))
    return kernels, noise


def sliding(rows: npt.NDArray[Any], length: int) -> npt.NDArray[Any]:
    """Every ``length`` rows in a row, shape (n, length, channels), without a copy.

    As ``sliding_window_view``, at a tenth of its cost; ``rows`` must be C-contiguous.
    """
    step, item = rows.strides
    shape = (len(rows) - length + 1, length, rows.shape[1])
    return np.ndarray(shape, rows.dtype, rows, 0, (step, step, item))
