"""Scans that were lost: what a kernel is given in their place, and what that is not good for.

A kernel knows no time: without them it would read a lost scan as a faster motion. They fill
memories, and nothing is told of them.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from flea_diag.core.residuals.residual import PARITIES
from flea_diag.core.residuals.residual_rows import (
    INNOVATION_INDEX,
    RESIDUAL_INDEX,
    TEMPERATURES,
    ResidualRows,
)
from flea_diag.core.smoothing import KERNEL_LENGTH

Array = npt.NDArray[np.float64]
Flags = npt.NDArray[np.bool_]

FINE_COLUMNS = [RESIDUAL_INDEX["parity_speed"]]
SPARSE_COLUMNS = [*(RESIDUAL_INDEX[row.name] for row in PARITIES), *INNOVATION_INDEX.values()]
THERMAL_COLUMNS = [RESIDUAL_INDEX[name] for name in TEMPERATURES]
MOST_FILLED = KERNEL_LENGTH // 2
"""Lost scans in a kernel; with more of them it averages less noise than any limit counts on."""


class LostScans:
    """Fills what is lost between the last scans and the next."""

    def __init__(self) -> None:
        self._wait = 0
        self._filled: Flags = np.zeros(KERNEL_LENGTH - 1, dtype=bool)
        self.interrupt()

    def interrupt(self) -> None:
        """There is a gap before the next scan."""
        self._rows: list[Array] = []

    def remember(self, rows: Array) -> None:
        """Scans that came."""
        self._rows = [*self._rows, *rows[-2:]][-2:]

    def filled(self, count: int, row: Array) -> Array | None:
        """So many rows before this one, on the parabola through their neighbours.

        None where a single scan is all there is before it: no line goes through that.
        """
        if len(self._rows) < 2:
            return None
        self._wait = KERNEL_LENGTH + count
        steps = np.arange(1.0, count + 1.0)
        return parabola(steps[:, None], count + 1, (*self._rows, row))

    def leave_out(self, residuals: ResidualRows, read: bool) -> bool:
        """Leave out what a line through lost scans would say otherwise than readings do.

        A reading that was not smoothed has no value there; two sensors of the same speed agree
        better than any line; a kernel with few readings is noisier than its limits know. Then a
        filter cannot bridge most of what it should have read, either: whether that is so.
        """
        if not self._wait:
            return False
        scans = len(residuals)
        filled = np.concatenate((self._filled, np.full(scans, not read)))
        self._filled = filled[scans:]
        inside = np.lib.stride_tricks.sliding_window_view(filled, KERNEL_LENGTH).sum(axis=1)
        starved = inside > MOST_FILLED
        residuals.leave_out(starved, SPARSE_COLUMNS)
        residuals.leave_out(filled[-scans:], THERMAL_COLUMNS)
        wrong = np.arange(scans) < self._wait
        residuals.leave_out(wrong, FINE_COLUMNS)
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
