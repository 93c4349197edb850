"""Balances that hold only some time after a stop.

A drive that nobody reads goes on taking the current of the motion for a while before it lowers that
of its standstill: a stepper's for about a second. What it takes then is neither its idle current
nor any power of the motion, so the balance is void until that time has passed and the smoothing
kernel holds nothing of it.
"""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from flea_diag.core.residuals.residual_rows import ResidualRows, ResidualSet

Flags = npt.NDArray[np.bool_]
Counts = npt.NDArray[np.int64]

NEVER = 1 << 40
"""Scans since a motion before the first one: a stream begins settled."""


def scans_of(settles_s: float, period_s: float, kernel_length: int) -> int:
    """Smoothed scans after a stop that are void."""
    return math.ceil(settles_s / period_s) + kernel_length // 2 if settles_s else 0


def scans_since(moving: Flags, before: int = NEVER) -> Counts:
    """Scans since the last one in motion, shape (n,), 0 in motion; ``before``: at the last scan."""
    scans = np.arange(len(moving), dtype=np.int64)
    return scans - np.maximum.accumulate(np.where(moving, scans, -1 - before))


class Settling:
    """Drops the residuals of one stream that have not settled."""

    def __init__(self, known: ResidualSet, period_s: float, kernel_length: int) -> None:
        waits = [(row.name, row.settles_s) for row in known.parities if row.settles_s]
        self._waits = [
            (known.place[name], scans_of(settles_s, period_s, kernel_length))
            for name, settles_s in waits
        ]
        self._since = NEVER

    def leave_out(self, rows: ResidualRows) -> None:
        """Take n scans, one after the other."""
        if not self._waits:
            return
        since = scans_since(rows.moving, self._since)
        self._since = int(since[-1])
        for column, scans in self._waits:
            rows.leave_out((since > 0) & (since <= scans), [column])
