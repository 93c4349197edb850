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

SHIFTING = tuple(RESIDUALS[j].name for j in SPREAD_ROWS)
"""Residuals in which units differ: there a run knows its own level better than the calibration."""


class ShiftTest:
    """Runs every test that the calibration has a limit for."""

    def __init__(self, limits: Sequence[ShiftLimit], tolerance: Sequence[float]) -> None:
        self._change = np.zeros(len(tolerance))
        self._tolerance = np.array(tolerance)
        self._tests = []
        for name in dict.fromkeys(limit.name for limit in limits):
            mine = [limit for limit in limits if limit.name == name]
            level = LevelShift([limit.window for limit in mine], 1 + len(tolerance))
            self._tests.append((RESIDUAL_INDEX[name], level, mine))

    def adopt(self, change: Sequence[float]) -> None:
        """The unit's parameters changed by so much: levels go on as if they had not."""
        self._change = np.array(change)

    def turn(self, opened: bool) -> None:
        """An episode has opened: the level before it is the one that counts. Or closed."""
        for _, level, _ in self._tests:
            level.freeze() if opened else level.clear()

    def step(self, rows: ResidualRows, results: TestResults, alone: Flags) -> None:
        """Where a shift is beyond its limit and no other test of its residual is, it counts.

        The zero of a voltage that stands ``alone``, shape (n,), wanders by itself: that it does
        says nothing of the actuator.
        """
        for column, level, limits in self._tests:
            values = self._as_calibrated(rows, column)
            row = RESIDUALS[column]
            shifts = level.step(values, rows.moving | (row.gate != "moving"))
            if "motor_voltage" in row.needs:
                shifts[alone] = np.nan
            self._judge(shifts, column, limits, results)

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
    ) -> None:
        """Fill the results in."""
        quiet = ~(np.abs(results.z[:, column]) > results.k[:, column])
        for number, limit in enumerate(limits):
            shift, unit = shifts[:, number, 0], shifts[:, number, 1:]
            z = shift / np.sqrt(limit.sigma**2 + np.add.reduce(np.square(unit), axis=1))
            beyond = quiet & (np.abs(z) > limit.k)
            if beyond.any():
                results.z[beyond, column], results.k[beyond, column] = z[beyond], limit.k
                results.window[beyond, column] = limit.window
