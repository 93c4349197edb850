"""Rows that a driver sends once more instead of reading its sensors: frozen, with new stamps."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]
Flags = npt.NDArray[np.bool_]

LEAST_CHANNELS = 3
"""So many channels with noise of their own never repeat themselves all at once."""


class StaleRows:
    """Compares each row with the one before it, across blocks."""

    def __init__(self, channels: int) -> None:
        self.last = np.full(channels, np.nan)
        """The last row; nothing is equal to NaN, so the first has no predecessor."""

    def find(self, rows: Array) -> Flags | None:
        """Which of n >= 1 rows say what the one before says; None where none does.

        In every channel that either of them reads, and so that chance will not do.
        """
        before = np.concatenate((self.last[None], rows[:-1]))
        self.last = rows[-1].copy()
        same = rows == before
        many = np.add.reduce(same, axis=1) >= LEAST_CHANNELS
        if not many.any():
            return None
        same |= np.isnan(rows) & np.isnan(before)
        stale: Flags = many & same.all(axis=1)
        return stale if stale.any() else None
