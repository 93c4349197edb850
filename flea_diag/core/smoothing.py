"""One causal FIR kernel for value, first and second derivative of every slow channel.

A linear relation between signals (Kirchhoff, Newton) still holds between the same signals
seen through one common linear filter. So parity relations are formed on smoothed signals,
all with this kernel, and no term leads another. It also averages a voltage that was sampled
as raw PWM. The price is a delay of half the kernel.
"""

from __future__ import annotations

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
    """Last ``length`` rows of so many channels and their smoothed derivatives.

    NaN in one channel makes only that channel NaN, for as long as it stays in the window.
    """

    def __init__(self, channels: int, length: int, period_s: float) -> None:
        self._kernels = hann_kernels(length, period_s)
        self._length = length
        # Written twice, half a buffer apart, so that the window is always contiguous.
        self._rows = np.full((2 * length, channels), np.nan)
        self._next = 0
        self.delay_s = (length - 1) / 2 * period_s

    def push(self, row: Array) -> Array:
        """Take one row, shape (channels,); returns shape (3, channels) at the delayed centre."""
        self._rows[self._next] = row
        self._rows[self._next + self._length] = row
        self._next = (self._next + 1) % self._length
        window = self._rows[self._next : self._next + self._length]
        derivatives: Array = self._kernels @ window
        return derivatives

    def clear(self) -> None:
        """Forget everything; the next ``length - 1`` results are NaN."""
        self._rows[:] = np.nan
        self._next = 0
