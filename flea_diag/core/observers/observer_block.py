"""Input and output of the state observer for n scans.

The compiled loop (``track_loops.track_loops``) and the loop in Python fill the same rows, so that
all later steps exist once, on ``Innovations``.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from flea_diag.core.observers.driven_model import INPUTS as DRIVEN_BY
from flea_diag.core.observers.driven_model import STATES
from flea_diag.core.observers.state_filter import Innovation
from flea_diag.core.residuals.driven_equations import CHANNELS as MOVED
from flea_diag.core.residuals.driven_equations import COMMAND as COMMANDED
from flea_diag.core.residuals.driven_equations import HEATED
from flea_diag.core.residuals.residual_rows import ResidualSet

Array = npt.NDArray[np.float64]
Flags = npt.NDArray[np.bool_]

PREDICTED = (*MOVED, *HEATED)
"""Channels that the observer predicts, in the order of its innovations."""
ABSURD = 1.0e6
"""No channel of a test stand reaches this value in SI units: not a measurement."""
TEMPERATURES = (*HEATED, "ambient_temperature")
"""Readings that heated stores may exchange heat with, those of their own first."""


P, ALL = len(MOVED), len(PREDICTED)
WARM = 3 * P + len(STATES) + 2
"""Start of the temperatures in a raw row, after the filter's innovation."""
RAW = WARM + 4 * len(HEATED)
"""Length of a raw row; each temperature has prediction, residual, sigma and estimate."""
_HEAT = WARM + 4 * np.arange(len(HEATED))
ORDER = np.concatenate(
    [
        *(np.concatenate([part * P + np.arange(P), _HEAT + part]) for part in range(3)),
        3 * P + np.arange(len(STATES)),
        _HEAT + 3,
        [WARM - 2, WARM - 1],
    ]
)


class ReadingColumns(NamedTuple):
    """Where a row of readings holds what the filter takes, -1 where the stand lacks a channel."""

    motion: tuple[int, ...]
    inputs: tuple[int, ...]
    command: int
    degc: tuple[int, ...]

    @classmethod
    def of(cls, rows: ResidualSet) -> ReadingColumns:
        """Of one stand."""
        motion, inputs, degc = (
            tuple(map(rows.channel, names)) for names in (MOVED, DRIVEN_BY, TEMPERATURES)
        )
        return cls(motion, inputs, rows.channel(COMMANDED), degc)


def innovated_places(rows: ResidualSet) -> tuple[int, ...]:
    """Places in ``PREDICTED`` of the channels whose innovations are tested."""
    return tuple(PREDICTED.index(channel) for channel in rows.innovated)


def _taken(rows: Array, columns: tuple[int, ...]) -> Array:
    """These columns, NaN for one that is lacking."""
    found = rows.take(columns, axis=1)
    found[:, np.array(columns) < 0] = np.nan
    return found


class Scans(NamedTuple):
    """Readings of n scans as the filter takes them, NaN = not measured.

    ``u`` inputs, shape (n, 2); ``y`` measurements, shape (n, 5); ``held`` those of them that
    count while frozen; ``degc`` motor, nut and ambient temperature, shape (n, 3).
    """

    u: Array
    y: Array
    held: Array
    degc: Array

    @classmethod
    def empty(cls, count: int) -> Scans:
        """Uninitialised arrays for ``count`` scans."""
        y, held = np.empty((2, count, P))
        return cls(np.empty((count, len(DRIVEN_BY))), y, held, np.empty((count, len(TEMPERATURES))))

    @classmethod
    def read(
        cls,
        rows: Array,
        columns: ReadingColumns,
        absent: Flags,
        command: tuple[float, float],
        driving: Flags,
    ) -> Scans:
        """From rows of readings; without a voltage ``command`` (offset, gain) gives it."""
        rows = np.where(np.abs(rows) < ABSURD, rows, np.nan)
        y, u = _taken(rows, columns.motion), _taken(rows, columns.inputs)
        y[:, absent] = np.nan
        lost = np.isnan(u[:, 0])
        if lost.any() and columns.command >= 0:
            u[lost, 0] = command[0] + command[1] * rows[lost, columns.command]
        return cls(u, y, np.where(driving, y, np.nan), _taken(rows, columns.degc))


class Innovations(NamedTuple):
    """``Innovation`` of n scans, a row of ``table`` each, for all of ``PREDICTED``."""

    table: Array
    measured: npt.NDArray[np.int64]
    diverged: Flags

    @classmethod
    def joined(cls, raw: Array, measured: npt.NDArray[np.int64], diverged: Flags) -> Innovations:
        """Motion and the independent temperatures in one, from raw rows; ``measured`` of motion."""
        table = raw.take(ORDER, axis=1)
        warmth = table[:, ALL + P : 2 * ALL] / table[:, 2 * ALL + P : 3 * ALL]
        seen = warmth == warmth
        warmth[~seen] = 0.0
        table[:, -2] += (warmth * warmth).sum(axis=1)
        return cls(table, measured + seen.sum(axis=1), diverged)

    def scan(self, number: int) -> Innovation:
        """Innovation of one scan."""
        measured, diverged = self.measured.item(number), self.diverged.item(number)
        return Innovation(self.table[number], ALL, measured, diverged)

    @property
    def predictions(self) -> Array:
        """Shape (n, channels)."""
        return self.table[:, :ALL]

    @property
    def residuals(self) -> Array:
        """Shape (n, channels), NaN where nothing was measured."""
        return self.table[:, ALL : 2 * ALL]

    @property
    def sigmas(self) -> Array:
        """Shape (n, channels), 0 where nothing was measured."""
        return self.table[:, 2 * ALL : 3 * ALL]

    @property
    def means(self) -> Array:
        """Estimated states after each scan: of motion, then temperatures; shape (n, 6)."""
        return self.table[:, 3 * ALL : -2]

    @property
    def nis(self) -> Array:
        """Normalised innovation squared, shape (n,)."""
        return self.table[:, -2]

    @property
    def ess(self) -> Array:
        """Effective sample size before resampling, shape (n,); inf without particles."""
        return self.table[:, -1]
