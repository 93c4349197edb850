"""The tests of ``level_shift`` on a stream of residuals, beside those against the calibration.

A voltage that nothing corroborates has a zero that wanders: by itself its shift says nothing.
A current that reads b too much moves the electrical relation by -R b and the mechanical one by
K b, so the load cell is a witness: where the two deviate in opposite directions, their common
distance from zero is held against the limit that the shift alone would have, and both deviate.
A witness adds no more than the voltage says itself: a drag alone is none.
"""

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
MECHANICAL = RESIDUAL_INDEX["parity_mechanical"]
WITNESS = 2.0
"""Sigmas of the mechanical relation from which on it is a witness."""
SHIFTING = tuple(RESIDUALS[j].name for j in SPREAD_ROWS)
"""Residuals in which units differ: there a run knows its own level better than the calibration."""


class ShiftTest:
    """Runs every test that the calibration has a limit for."""

    def __init__(
        self, limits: Sequence[ShiftLimit], tolerance: Sequence[float], backend: str = "auto"
    ) -> None:
        self._change = np.zeros(len(tolerance))
        self._tolerance = np.array(tolerance)
        self._open = False
        self._fired: list[int] = []
        self._openers: list[int] = []
        """Columns whose shift has just counted, and those by which an episode was opened."""
        # Those of one residual stand together, as their tests do.
        names = list(dict.fromkeys(limit.name for limit in limits))
        self._limits = sorted(limits, key=lambda limit: names.index(limit.name))
        self._variance = np.array([limit.sigma**2 for limit in self._limits])
        self._k = np.array([limit.k for limit in self._limits])
        self._tests = []
        for name in names:
            places = [n for n, limit in enumerate(self._limits) if limit.name == name]
            windows = [self._limits[n].window for n in places]
            column = RESIDUAL_INDEX[name]
            gated = RESIDUALS[column].gate == "moving"
            level = LevelShift(windows, 1 + len(tolerance), gated, backend)
            self._tests.append((column, level, slice(places[0], places[-1] + 1)))

    def adopt(self, change: Sequence[float]) -> None:
        """The unit's parameters changed by so much: levels go on as if they had not."""
        self._change = np.array(change)

    def turn(self, opened: bool) -> None:
        """An episode has opened: the level before it is the one that counts. Or closed."""
        self._open, self._openers = opened, self._fired if opened else []
        for _, level, _ in self._tests:
            level.freeze() if opened else level.clear()

    def step(self, rows: ResidualRows, results: TestResults, alone: Flags) -> None:
        """Where a shift is beyond its limit and no other test of its residual is, it counts.

        In an episode that no shift has opened it says nothing: the fault may have come with
        another unit, whose level is another. A voltage that stands ``alone``, shape (n,), needs a
        witness to open one, and says nothing in one that anything else has opened.
        """
        self._fired = []
        if self._open and not self._openers:
            return
        z, shifts = self._z(rows)
        if not alone.any() and not (np.abs(z) > self._k).any():
            return
        for column, _, places in self._tests:
            here = z[:, places]
            if "motor_voltage" in RESIDUALS[column].needs and alone.any():
                here = np.where(alone[:, None], self._witnessed(here, column, results), here)
            beyond = self._judge(here, column, self._limits[places], results, shifts[:, places])
            if beyond[-1]:
                self._fired.append(column)
            if column == ELECTRICAL:
                self._call_witness(beyond & alone, results)

    def _z(self, rows: ResidualRows) -> tuple[Array, Array]:
        """Every shift, in sigmas of itself and of what units differ by, and as it is.

        Both of shape (n, limits).
        """
        if not self._tests:
            return np.empty((len(rows), 0)), np.empty((len(rows), 0))
        learned = np.add.reduce(rows.spread * self._change, axis=2)
        spread = rows.spread * self._tolerance
        always, shifts = np.ones(len(rows), dtype=bool), []
        for column, level, _ in self._tests:
            # The residual as if nothing had been learned of the unit, and what units differ by.
            place = SPREAD_ROWS.index(column)
            values = np.empty((len(rows), 1 + len(self._tolerance)))
            values[:, 0] = rows.values[:, column] - learned[:, place]
            values[:, 1:] = spread[:, place]
            gated = RESIDUALS[column].gate == "moving"
            shifts.append(level.step(values, rows.moving if gated else always))
        every = np.concatenate(shifts, axis=1)
        variance = self._variance + np.add.reduce(np.square(every[:, :, 1:]), axis=2)
        return np.asarray(every[:, :, 0] / np.sqrt(variance)), every[:, :, 0]

    def _witnessed(self, z: Array, column: int, results: TestResults) -> Array:
        """What the shift of a voltage that stands alone amounts to, NaN where to nothing."""
        if column == ELECTRICAL and column in self._openers:
            return z
        if column != ELECTRICAL or self._open:
            return np.full_like(z, np.nan)
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
    def _judge(
        z: Array,
        column: int,
        limits: Sequence[ShiftLimit],
        results: TestResults,
        shifts: Array,
    ) -> Flags:
        """Fill the results in; after which scans a shift counts."""
        quiet = ~(np.abs(results.z[:, column]) > results.k[:, column])
        counts = np.zeros(len(quiet), dtype=bool)
        for each, shift, limit in zip(z.T, shifts.T, limits, strict=True):
            beyond = quiet & (np.abs(each) > limit.k)
            results.z[beyond, column], results.k[beyond, column] = each[beyond], limit.k
            results.window[beyond, column] = limit.window
            results.shift[beyond, column] = shift[beyond]
            counts |= beyond
        return counts
