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

"""Disturbance forces of the load actuator, as measured by the recorded load cell.

Roughness grows with speed. Occasionally the load actuator sticks and pushes back for some
hundredths of a second, mostly under load.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from flea_diag.fields.values import AboveZero
from flea_sim_driver.plant.plant import STEP_S

Array = npt.NDArray[np.float64]
COLUMNS = ("feedback", "roughness", "catch")
KNOT_STEPS = 50
"""Steps between the knots of the roughness (40 Hz), which is linear between them."""


@dataclass(frozen=True)
class Catches:
    """Rate and force at which the load actuator sticks."""

    rate_hz: float
    rate_per_n_s: float
    mean_n: float
    largest_n: float
    length_s: AboveZero


class Disturbance:
    """Columns (steps, 3): unit noise of the position loop, unit roughness, catch in N."""

    def __init__(self, generator: np.random.Generator, catches: Catches) -> None:
        self._generator = generator
        self._catches = catches
        self._knot = 0.0
        length = round(catches.length_s / STEP_S)
        phase = np.pi * np.arange(length) / length
        self._shape = np.sin(phase) * np.sign(np.cos(6.0 * phase) + 0.4)
        self._rest = np.zeros(0)

    def block(self, steps: int, load_n: float, block_s: float) -> Array:
        """Disturbances of one block under this commanded load."""
        draw = self._generator
        out = np.zeros((steps, len(COLUMNS)))
        out[:, 0] = draw.standard_normal(steps)
        knots = np.concatenate([[self._knot], draw.standard_normal(steps // KNOT_STEPS)])
        self._knot = float(knots[-1])
        out[:, 1] = np.interp(np.arange(steps), np.arange(len(knots)) * KNOT_STEPS, knots)
        out[:, 2] = self._catching(steps, load_n, block_s)
        return out

    def _catching(self, steps: int, load_n: float, block_s: float) -> Array:
        """Half-sine pulses with ringing, continued across the end of a block."""
        chance, size, at = self._generator.random(3)
        rate = self._catches.rate_hz + self._catches.rate_per_n_s * abs(load_n)
        span = np.zeros(steps + len(self._shape))
        span[: len(self._rest)] = self._rest
        if chance < rate * block_s:
            start = int(at * steps)
            push = -self._catches.mean_n * np.log1p(-size)
            span[start : start + len(self._shape)] += (
                min(push, self._catches.largest_n) * self._shape
            )
        self._rest = span[steps:].copy()
        return span[:steps]
