"""Bounded traces of streams of any length: the extremes of equal stretches of time.

Stretches double when there are too many of them, so that a spike of a single scan is still seen
in a trace of ten hours, and memory does not grow with the stream.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

MOST_STRETCHES = 512
FIRST_STRETCH_S = 0.05
DIGITS = 5

Array = npt.NDArray[np.float64]


class Envelope:
    """Extremes of several columns over stretches of time.

    Parameters
    ----------
    columns
        How many values each sample has.
    """

    def __init__(self, columns: int) -> None:
        self.stretch_s = FIRST_STRETCH_S
        self._low = np.full((MOST_STRETCHES, columns), math.inf)
        self._high = np.full((MOST_STRETCHES, columns), -math.inf)
        self._used = 0

    def add(self, time_s: float, values: Sequence[float]) -> None:
        """Take one sample at ``time_s`` >= 0 after the start; NaN leaves its column alone."""
        at = int(time_s / self.stretch_s)
        while at >= MOST_STRETCHES:
            self._double()
            at = int(time_s / self.stretch_s)
        self._used = max(self._used, at + 1)
        row = np.asarray(values, dtype=np.float64)
        np.fmin(self._low[at], row, out=self._low[at])
        np.fmax(self._high[at], row, out=self._high[at])

    def _double(self) -> None:
        half = MOST_STRETCHES // 2
        low, high = self._low.copy(), self._high.copy()
        self._low[:half] = np.minimum(low[0::2], low[1::2])
        self._high[:half] = np.maximum(high[0::2], high[1::2])
        self._low[half:], self._high[half:] = math.inf, -math.inf
        self._used = (self._used + 1) // 2
        self.stretch_s *= 2.0

    def extremes(self, column: int) -> tuple[list[float | None], list[float | None]]:
        """Lowest and highest value of each stretch; None where the column had none."""
        return (
            _rounded(self._low[: self._used, column]),
            _rounded(self._high[: self._used, column]),
        )


def _rounded(values: Array) -> list[float | None]:
    return [float(f"{v:.{DIGITS}g}") if math.isfinite(v) else None for v in values.tolist()]
