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

"""Lost scans: interpolated rows for the smoothing kernel, and the residuals they invalidate.

The kernel assumes a constant period: without them a lost scan would read as a faster motion.
Interpolated rows fill the memories of kernel and filters; no record is made of them.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from flea_diag.core.residuals.residual_rows import ResidualRows, ResidualSet

Array = npt.NDArray[np.float64]
Flags = npt.NDArray[np.bool_]


class LostScans:
    """Interpolation between the last scans before a loss and the first after it."""

    def __init__(self, known: ResidualSet, kernel: int) -> None:
        self._kernel = kernel
        # Beyond, a kernel averages less noise than the limits assume.
        self._most_filled = kernel // 2
        parities = known.columns(row.name for row in known.parities)
        self._sparse = [*parities, *known.columns(known.innovations)]
        self._thermal, self._fine = known.predicted_columns, known.columns(known.of_one_speed)
        self._wait = 0
        self._filled: Flags = np.zeros(self._kernel - 1, dtype=bool)
        self.interrupt()

    def interrupt(self) -> None:
        """There is a gap before the next scan."""
        self._rows: tuple[Array, ...] = ()
        """The last rows, of one scan or two each."""

    def remember(self, rows: Array) -> None:
        """Keep the last two received scans."""
        self._rows = (*self._rows[-1:], rows[-2:])

    def filled(self, count: int, row: Array) -> Array | None:
        """``count`` rows before this one, on the parabola through their neighbours.

        None with fewer than two scans before it: no parabola is defined.
        """
        if sum(map(len, self._rows)) < 2:
            return None
        self._wait = self._kernel + count
        steps = np.arange(1.0, count + 1.0)
        return parabola(steps[:, None], count + 1, (*np.concatenate(self._rows)[-2:], row))

    def leave_out(self, residuals: ResidualRows, read: bool) -> bool:
        """Drop residuals that interpolation would falsify; whether filters must restart.

        Unsmoothed readings have no value in a lost scan; two sensors of the same speed agree
        better than any interpolation; a kernel with few readings is noisier than its limits
        assume, and then a filter cannot bridge the loss either.
        """
        if residuals.noise is not None:
            bridged = residuals.noise[:, self._fine] > 1.0
            residuals.values[:, self._fine] = np.where(
                bridged, np.nan, residuals.values[:, self._fine]
            )
        if not self._wait:
            return False
        scans = len(residuals)
        filled = np.concatenate((self._filled, np.full(scans, not read)))
        self._filled = filled[scans:]
        inside = np.lib.stride_tricks.sliding_window_view(filled, self._kernel).sum(axis=1)
        starved = inside > self._most_filled
        residuals.leave_out(starved, self._sparse)
        residuals.leave_out(filled[-scans:], self._thermal)
        wrong = np.arange(scans) < self._wait
        residuals.leave_out(wrong, self._fine)
        self._wait -= int(np.count_nonzero(wrong))
        return bool(starved[-1])


def parabola(at: Array, ahead: int, rows: Sequence[Array]) -> Array:
    """Values at ``at`` of the parabola through rows at -1, 0 and ``ahead`` (Lagrange)."""
    before, last, following = rows
    return np.asarray(
        before * at * (at - ahead) / (1 + ahead)
        - last * (at + 1) * (at - ahead) / ahead
        + following * (at + 1) * at / ((ahead + 1) * ahead)
    )
