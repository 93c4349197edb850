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

"""Innovations of signals in the noise of the residuals: a Kalman filter of level and colour.

The gains depend on the noise and on which windows have values, never on the values: the filter is
linear. Sent through it, residuals are white, and the effect of a fault that begins at some window
is what the same filter makes of it from there on (Willsky and Jones 1976).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from flea_diag.core.run_law.level_noise import LevelNoise

Array = npt.NDArray[np.float64]
Flags = npt.NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class WindowGain:
    """What the filter does in one window, arrays of shape (..., residuals, 1)."""

    level: Array
    coloured: Array
    phi: Array
    scale: Array


class GainSequence:
    """Gains of all residuals, window by window."""

    def __init__(self, noise: LevelNoise) -> None:
        self._noise = noise
        self._p_level = noise.start.copy()
        self._p_both = np.zeros_like(noise.start)
        self._p_coloured = noise.coloured.copy()

    def step(self, known: Flags) -> WindowGain:
        """Gains for a window in which these residuals have a value, shape (..., residuals)."""
        noise, both = self._noise, self._p_both
        level, coloured = self._p_level + both, self._p_coloured + both
        variance = level + coloured + noise.white
        gains = (np.where(known, part / variance, 0.0) for part in (level, coloured))
        to_level, to_coloured = gains
        scale = np.where(known, 1.0 / np.sqrt(variance), 0.0)
        self._p_level = self._p_level - to_level * level + noise.walk
        self._p_both = noise.phi * (both - to_level * coloured)
        renewed = (1.0 - np.square(noise.phi)) * noise.coloured
        self._p_coloured = (
            np.square(noise.phi) * (self._p_coloured - to_coloured * coloured) + renewed
        )
        columns = (to_level, to_coloured, noise.phi, scale)
        return WindowGain(*(column[..., None] for column in columns))


class WhiteSignals:
    """State of the filter for many signals, shape (..., residuals, signals)."""

    def __init__(self, shape: tuple[int, ...]) -> None:
        self._level, self._coloured = np.zeros(shape), np.zeros(shape)

    def step(self, signals: Array, gain: WindowGain) -> Array:
        """Innovations of this window over their standard deviation; 0 where there is no value."""
        apart = signals - self._level - self._coloured
        self._level = self._level + gain.level * apart
        self._coloured = gain.phi * (self._coloured + gain.coloured * apart)
        return np.asarray(gain.scale * apart)

    def keep(self, which: Flags) -> None:
        """Drop the others, along the first axis."""
        self._level, self._coloured = self._level[which], self._coloured[which]

    def begin(self) -> None:
        """One more along the first axis, at zero."""
        one = np.zeros((1, *self._level.shape[1:]))
        self._level = np.concatenate((self._level, one))
        self._coloured = np.concatenate((self._coloured, one))
