"""The tests of ``level_shift`` on a stream of residuals, beside those against the calibration."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from flea_diag.core.detection import TestResults
from flea_diag.core.level_shift import LevelShift, ShiftLimit
from flea_diag.core.residual_bank import RESIDUAL_INDEX, RESIDUALS, SPREAD_ROWS, ResidualRows

Array = npt.NDArray[np.float64]
Flags = npt.NDArray[np.bool_]

ELECTRICAL = RESIDUAL_INDEX["parity_electrical"]
SHIFTING = tuple(RESIDUALS[j].name for j in SPREAD_ROWS)
"""Residuals in which units differ: there a run knows its own level better than the calibration."""


class ShiftTest:
    """Runs every test that the calibration has a limit for."""

    def __init__(self, limits: Sequence[ShiftLimit], tolerance: Sequence[float]) -> None:
        self._change = np.zeros(len(tolerance))
        self._tolerance = np.array(tolerance)
        self._tests = []
        self._open = self._opener = self._fired = False
        for name in dict.fromkeys(limit.name for limit in limits):
            mine = [limit for limit in limits if limit.name == name]
            level = LevelShift([limit.window for limit in mine], 1 + len(tolerance))
            self._tests.append((RESIDUAL_INDEX[name], level, mine))

    def adopt(self, change: Sequence[float]) -> None:
        """The unit's parameters changed by so much: levels go on as if they had not."""
        self._change = np.array(change)

    def turn(self, opened: bool) -> None:
        """An episode has opened: the level before it is the one that counts. Or closed."""
        self._open, self._opener = opened, opened and self._fired
        for _, level, _ in self._tests:
            level.freeze() if opened else level.clear()

    def step(self, rows: ResidualRows, results: TestResults, alone: Flags) -> None:
        """Where a shift is beyond its limit and no other test of its residual is, it counts.

        A voltage that stands ``alone``, shape (n,), also wanders by itself: its shift may open an
        episode, but says nothing in one that something else has opened.
        """
        for column, level, limits in self._tests:
            values = self._as_calibrated(rows, column)
            moves = rows.moving | (RESIDUALS[column].gate != "moving")
            shifts = level.step(values, moves)
            if column == ELECTRICAL and self._open and not self._opener:
                shifts = np.where(alone[:, None, None], np.nan, shifts)
            beyond = self._judge(shifts, column, limits, results)
            if column == ELECTRICAL:
                self._fired = beyond

    def _as_calibrated(self, rows: ResidualRows, column: int) -> Array:
        """The residual as if nothing had been learned of the unit, and what units differ by."""
        spread = rows.spread[:, SPREAD_ROWS.index(column)]
        learned = np.add.reduce(spread * self._change, axis=1)
        values = np.empty((len(rows), 1 + spread.shape[1]))
        values[:, 0], values[:, 1:] = rows.values[:, column] - learned, spread * self._tolerance
        return values

    @staticmethod
    def _judge(
        shifts: Array, column: int, limits: Sequence[ShiftLimit], results: TestResults
    ) -> bool:
        """Fill the results in; whether a shift counts after the last scan."""
        quiet = ~(np.abs(results.z[:, column]) > results.k[:, column])
        last = False
        for number, limit in enumerate(limits):
            shift, unit = shifts[:, number, 0], shifts[:, number, 1:]
            z = shift / np.sqrt(limit.sigma**2 + np.add.reduce(np.square(unit), axis=1))
            beyond = quiet & (np.abs(z) > limit.k)
            if beyond.any():
                results.z[beyond, column], results.k[beyond, column] = z[beyond], limit.k
                results.mean[beyond, column] = shift[beyond]
                results.window[beyond, column] = limit.window
                last |= bool(beyond[-1])
        return last
