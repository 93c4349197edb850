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
"""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]


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


class Smoother:
    """Smoothed values and derivatives of several channels, and the rows they are computed from.

    NaN in one channel makes only that channel NaN, for as long as it stays in the window.
    """

    def __init__(self, channels: int, length: int, period_s: float) -> None:
        self._kernels = hann_kernels(length, period_s)
        self._length = length
        self._before = np.full((length - 1, channels), np.nan)

    def push(self, rows: Array) -> tuple[Array, Array]:
        """Take rows, shape (n, channels), with n = 1 live and many in a replay.

        Returns
        -------
        recent : shape (length - 1 + n, channels), these rows after those before them
        derivatives : shape (n, 3, channels), each at its delayed centre
        """
        recent = np.concatenate((self._before, rows))
        self._before = recent[len(rows) :]
        # One product of the same shape for each row, whatever n is: the same last bits.
        return recent, np.matmul(self._kernels, sliding(recent, self._length))

    def clear(self) -> None:
        """Clear the window; the next ``length - 1`` results are NaN."""
        self._before = np.full_like(self._before, np.nan)


def sliding(rows: npt.NDArray[Any], length: int) -> npt.NDArray[Any]:
    """Every ``length`` rows in a row, shape (n, length, channels), without a copy.

    As ``sliding_window_view``, at a tenth of its cost; ``rows`` must be C-contiguous.
    """
    step, item = rows.strides
    shape = (len(rows) - length + 1, length, rows.shape[1])
    return np.ndarray(shape, rows.dtype, rows, 0, (step, step, item))
