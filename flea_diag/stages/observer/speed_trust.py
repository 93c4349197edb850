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

"""Trust in a speed that is the derivative of a position: a position step reads as a speed."""

from __future__ import annotations

import numpy as np

from flea_diag.core.conditions.lingering import Lingering
from flea_diag.core.residual_values import ResidualRows
from flea_diag.core.residuals.residual_rows import SPEED, ResidualSet
from flea_diag.core.sensors.position_step import SPAN


class SpeedTrust:
    """Drops residuals of the speed for as long as the kernel contains a position step."""

    def __init__(self, known: ResidualSet, has_encoder: bool, kernel: int) -> None:
        self._position, self.columns = known.column(known.position), known.needing(SPEED)
        self._has_encoder = has_encoder
        self._stepped = Lingering(kernel + SPAN)

    def leave_out(self, residuals: ResidualRows) -> None:
        """Drop them in these scans; an encoder measures the speed itself and is left alone."""
        if self._has_encoder or self._position < 0:
            return
        stepped = np.abs(residuals.values[:, self._position]) > 1.0
        wrong = self._stepped.step(stepped.tolist())
        if wrong is not None:
            residuals.leave_out(wrong, self.columns)
            residuals.moving[wrong] = False
