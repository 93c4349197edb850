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

"""Structural response of one actuator: its resonances at motor housing and nut.

Mounting differs from unit to unit, so each draws its own resonances, damping and background.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from flea_diag.wire.parameters import parameter

Array = npt.NDArray[np.float64]
RING_S = 0.04
FINE_RATE_HZ = 256_000.0
DAMPING_LIMIT = 0.3
RESONANCE_LIMIT = 0.5


@dataclass(frozen=True)
class Mode:
    """One resonance: frequency, damping ratio and its weight in the response."""

    frequency_hz: float
    damping: float
    weight: float

    def response(self, time_s: Array) -> Array:
        """Acceleration after a unit impulse."""
        omega = 2.0 * np.pi * self.frequency_hz
        swing = np.sin(omega * np.sqrt(1.0 - self.damping**2) * time_s)
        return np.asarray(self.weight * np.exp(-self.damping * omega * time_s) * swing)


@dataclass(frozen=True)
class Structure:
    """Modes and background (times the nominal one) at motor housing and nut."""

    modes: tuple[tuple[Mode, ...], ...]
    background: tuple[float, float] = (1.0, 1.0)

    def impulse_responses(self, rate_hz: float) -> Array:
        """Responses at motor housing and nut, shape (2, samples).

        Normalised to unit energy over all modes; modes above half the sampling rate are omitted,
        as by an anti-aliasing filter.
        """
        time = np.arange(int(RING_S * rate_hz)) / rate_hz
        return np.array([self._response(row, time, rate_hz) for row in self.modes])

    @staticmethod
    def _response(modes: tuple[Mode, ...], time: Array, rate_hz: float) -> Array:
        fine = np.arange(int(RING_S * FINE_RATE_HZ)) / FINE_RATE_HZ
        whole = np.sum([mode.response(fine) for mode in modes], axis=0)
        energy = np.sum(whole**2) * rate_hz / FINE_RATE_HZ
        seen = np.zeros_like(time)
        for mode in modes:
            if mode.frequency_hz < 0.5 * rate_hz:
                seen += mode.response(time)
        return np.asarray(seen / np.sqrt(energy))


@dataclass(frozen=True)
class StructureSpread:
    """Unit variability of the structure at ``unit_spread`` 1."""

    resonance: float = parameter(
        0.0, "half the width of a uniform draw of each resonance, relative", minimum=0.0,
        maximum=0.5,
    )  # fmt: skip
    damping: float = parameter(
        0.0, "standard deviation of the logarithm of each damping", minimum=0.0, maximum=1.0
    )
    background: float = parameter(
        0.0, "standard deviation of the logarithm of the background", minimum=0.0, maximum=1.0
    )

    def scaled(self, share: float) -> StructureSpread:
        """The same for a ``unit_spread``."""
        resonance = min(share * self.resonance, RESONANCE_LIMIT)
        return StructureSpread(resonance, share * self.damping, share * self.background)

    def draw(self, nominal: Structure, generator: np.random.Generator) -> Structure:
        """The structure of one unit; the number of random draws does not depend on the spread."""
        modes = tuple(tuple(self._mode(m, generator) for m in row) for row in nominal.modes)
        louder = np.exp(self.background * _bounded(generator, 2))
        return Structure(modes, (float(louder[0]), float(louder[1])))

    def _mode(self, mode: Mode, generator: np.random.Generator) -> Mode:
        shift = float(generator.uniform(-1.0, 1.0))
        damping = mode.damping * float(np.exp(self.damping * _bounded(generator, 1)[0]))
        return Mode(
            mode.frequency_hz * (1.0 + self.resonance * shift),
            min(damping, DAMPING_LIMIT),
            mode.weight,
        )


def _bounded(generator: np.random.Generator, count: int) -> Array:
    """Standard normal draws, cut at two standard deviations."""
    return np.asarray(np.clip(generator.standard_normal(count), -2.0, 2.0))
