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

"""Warm-up of a stream: the sensor offsets of this unit are learned once, at its start."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import numpy.typing as npt

from flea_diag.core.calibration.calibration import Calibration
from flea_diag.core.likelihood.unit_start import UnitStart, unit_start
from flea_diag.core.residuals.parameters import UNIT_PARAMETERS
from flea_diag.core.residuals.residual_rows import ResidualRows, ResidualSet
from flea_diag.core.residuals.unit_offsets import OffsetLearning

Stamps = npt.NDArray[np.int64]
Offsets = Mapping[str, tuple[float, float]]
"""Unit parameter -> its change from the calibrated value, and the sigma of that."""


class WarmUp:
    """Offset learning from ``begin``, with the first scan, until the warm-up time has passed."""

    def __init__(self, known: ResidualSet, calibration: Calibration, warm_up_s: float) -> None:
        self._known = known
        self._calibration = calibration
        self._length_ns = self._ends_ns = round(warm_up_s * 1e9)
        self._learning = {
            residual: OffsetLearning(name, calibration.tolerance)
            for residual, name in known.zeros.items()
        }
        self.unit = UnitStart()
        """Which unit has started; known after the last step."""
        # Of the unit alone: the relations of the zeros, and the others that units differ in.
        plain = (known.rows[j].name for j in known.spreading if not known.parities[j].normalised)
        self._others = {
            name: OffsetLearning(UNIT_PARAMETERS[0], calibration.tolerance)
            for name in plain
            if name not in self._learning and calibration.units
        }

    def begin(self, stamp_ns: int) -> None:
        """The first scan is that of this stamp."""
        self._ends_ns = stamp_ns + self._length_ns

    def leading(self, stamps_ns: Stamps) -> int:
        """How many of these scans may come in one block: the warm-up ends with a single one."""
        over = np.append(stamps_ns >= self._ends_ns, True)
        return int(over.argmax())  # the first: stamps may jump back after it

    def step(self, residuals: ResidualRows, stamp_ns: int, voltage_lost: bool) -> Offsets | None:
        """Learn from these scans; the offsets with the first scan after the warm-up.

        The zero of a voltage that is not trusted is not learned.
        """
        zeros = self._known.zeros
        if stamp_ns >= self._ends_ns:
            c = self._calibration
            learning = [*self._learning.values(), *self._others.values()]
            self.unit = unit_start(learning, c.parameters, c.tolerance, c.units)
            return {
                zeros[residual]: learning.offset()
                for residual, learning in self._learning.items()
                if not (zeros[residual] == "voltage_offset_v" and voltage_lost)
            }
        self._learn(residuals)
        return None

    def _learn(self, residuals: ResidualRows) -> None:
        for name, learning in (self._learning | self._others).items():
            limit = self._calibration.limit(name)
            if limit is not None:
                j = self._known.place[name]
                # A power needs no motion, and at rest an offset is all that is left of it.
                at_rest = name == self._known.friction and name not in self._known.in_motion
                use = np.ones_like(residuals.moving) if at_rest else residuals.moving
                values = residuals.values[use, j]
                spread = residuals.spread[use, self._known.spreading.index(j)]
                learning.add(values, spread, limit.sigma[0] ** 2 * limit.correlation_samples)
