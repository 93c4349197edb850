"""The tests of ``level_shift`` on a stream of residuals, beside those against the calibration.

A voltage that nothing corroborates has a zero that wanders: by itself its shift says nothing.
A current that reads b too much moves the electrical relation by -R b and the mechanical one by
K b, so the load cell is a witness: where the two deviate in opposite directions, their common
distance from zero is held against the limit that the shift alone would have, and both deviate.
A witness adds no more than the voltage says itself: a drag alone is none.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from flea_diag.core.detection import TestResults
from flea_diag.core.level_shift import LevelShift, ShiftLimit
from flea_diag.core.residual_bank import RESIDUAL_INDEX, RESIDUALS, SPREAD_ROWS, ResidualRows

Array = npt.NDArray[np.float64]
Flags = npt.NDArray[np.bool_]

ELECTRICAL = RESIDUAL_INDEX["parity_electrical"]
MECHANICAL = RESIDUAL_INDEX["parity_mechanical"]
WITNESS = 2.0
"""Sigmas of the mechanical relation from which on it is a witness."""
SHIFTING = tuple(RESIDUALS[j].name for j in SPREAD_ROWS)
"""Residuals in which units differ: there a run knows its own level better than the calibration."""


@dataclass(frozen=True)
class Bounds:
    """Windows of one residual, with variance and limit of each; shapes (windows,)."""

    windows: tuple[int, ...]
    variance: Array
    k: Array

    @classmethod
    def of(cls, limits: Sequence[ShiftLimit]) -> Bounds:
        """Those of these limits."""
        return cls(
            tuple(limit.window for limit in limits),
            np.array([limit.sigma**2 for limit in limits]),
            np.array([limit.k for limit in limits]),
        )

    def z(self, shifts: Array) -> Array:
        """Sigmas of shifts and of what units differ by, (n, windows, 1 + unit parameters)."""
        variance = self.variance + np.add.reduce(np.square(shifts[:, :, 1:]), axis=2)
        return np.asarray(shifts[:, :, 0] / np.sqrt(variance))


class ShiftTest:
    """Runs every test that the calibration has a limit for."""

    def __init__(self, limits: Sequence[ShiftLimit], tolerance: Sequence[float]) -> None:
        self._change = np.zeros(len(tolerance))
        self._tolerance = np.array(tolerance)
        self._tests = []
        self._open = self._opener = self._fired = False
        for name in dict.fromkeys(limit.name for limit in limits):
            mine = [limit for limit in limits if limit.name == name]
            column = RESIDUAL_INDEX[name]
            gated = RESIDUALS[column].gate == "moving"
            level = LevelShift([limit.window for limit in mine], 1 + len(tolerance), gated)
            self._tests.append((column, level, Bounds.of(mine)))

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

        A voltage that stands ``alone``, shape (n,), needs a witness to open an episode, and says
        nothing in one that something else has opened.
        """
        for column, level, bounds in self._tests:
            values = self._as_calibrated(rows, column)
            row = RESIDUALS[column]
            z = bounds.z(level.step(values, rows.moving | (row.gate != "moving")))
            if "motor_voltage" in row.needs and alone.any():
                z = np.where(alone[:, None], self._witnessed(z, column, results), z)
            beyond = self._judge(z, column, bounds, results)
            if column == ELECTRICAL:
                self._fired = bool(beyond[-1])
                self._call_witness(beyond & alone, results)

    def _as_calibrated(self, rows: ResidualRows, column: int) -> Array:
        """The residual as if nothing had been learned of the unit, and what units differ by."""
        spread = rows.spread[:, SPREAD_ROWS.index(column)]
        learned = np.add.reduce(spread * self._change, axis=1)
        values = np.empty((len(rows), 1 + spread.shape[1]))
        values[:, 0], values[:, 1:] = rows.values[:, column] - learned, spread * self._tolerance
        return values

    def _witnessed(self, z: Array, column: int, results: TestResults) -> Array:
        """What the shift of a voltage that stands alone amounts to, NaN where to nothing."""
        if column != ELECTRICAL or (self._open and not self._opener):
            return np.full_like(z, np.nan)
        if self._opener:
            return z
        force = results.z[:, MECHANICAL, None]
        speaks = (np.abs(force) > WITNESS) & (force * z < 0.0)
        added = np.minimum(np.abs(force), np.abs(z))
        return np.where(speaks, np.copysign(np.hypot(z, added), z), np.nan)

    def _call_witness(self, beyond: Flags, results: TestResults) -> None:
        """What opens an episode with a witness is a deviation of both relations."""
        if self._open or not beyond.any():
            return
        called = beyond & ~(np.abs(results.z[:, MECHANICAL]) > results.k[:, MECHANICAL])
        both, k = results.z[called, ELECTRICAL], results.k[called, ELECTRICAL]
        results.z[called, MECHANICAL], results.k[called, MECHANICAL] = -both, k

    @staticmethod
    def _judge(z: Array, column: int, bounds: Bounds, results: TestResults) -> Flags:
        """Fill the results in; after which scans a shift counts."""
        quiet = ~(np.abs(results.z[:, column]) > results.k[:, column])
        beyond = (np.abs(z) > bounds.k) & quiet[:, None]
        counts: Flags = beyond.any(axis=1)
        if counts.any():
            for n, here in enumerate(beyond.T):
                results.z[here, column], results.k[here, column] = z[here, n], bounds.k[n]
                results.window[here, column] = bounds.windows[n]
        return counts
