"""Whether the stand has gone over to another unit: thermocouples that step together.

Heat takes minutes, a fault of one sensor moves one reading, so two temperatures that step
within the same tenth of a second have one cause: they come from other thermocouples, those of
another unit. Its offsets are its own and are learned anew; none of this is a fault.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from flea_diag.core.smoothing import sliding

Array = npt.NDArray[np.float64]
Flags = npt.NDArray[np.bool_]

BEFORE, AFTER = 100, 12
"""Scans that a step is measured between: medians, for thermocouples spike."""
LENGTH = BEFORE + AFTER
PERIOD = 4
"""Every so many scans are judged."""
LIMIT = 6.0
"""Of a step in its standard errors; 3.6 is the most that two channels reach at once in the
public recordings of the FLEA, 0.16 million scans."""
LEAST_STEP_K = 0.3
TOGETHER = 2
"""So many channels must step."""
MEDIAN_ERROR = np.sqrt(np.pi / 2.0 * (1.0 / BEFORE + 1.0 / AFTER))
"""Standard error of a difference of medians of normal noise, in its sigma."""
MAD_SIGMA = 1.4826
MEANS_APART = np.repeat([-1.0 / BEFORE, 1.0 / AFTER], [BEFORE, AFTER])
"""Weights of a window's scans in the mean after a step less that before it."""


class UnitChange:
    """Follows temperatures, shape (n, channels); NaN is not judged."""

    def __init__(self) -> None:
        self.forget()

    def forget(self) -> None:
        """A stream begins."""
        self._rows: list[Array] = []
        self._count = 0

    def follow(self, temperatures: Array) -> int:
        """Take n scans; the first with which another unit is seen to be in use, or n."""
        n = len(temperatures)
        # Whichever way scans are dealt into blocks, the same ones are judged.
        first = (-self._count - 1) % PERIOD
        self._count += n
        self._rows.append(temperatures)
        if first >= n:
            return n
        rows = np.ascontiguousarray(np.concatenate(self._rows))
        self._rows = [rows[1 - LENGTH :]]
        if len(rows) < LENGTH:
            return n
        # Where the window begins that ends with the first scan that is due.
        begins = len(rows) - n + first + 1 - LENGTH
        if begins < 0:
            begins %= PERIOD
        seen = _together(sliding(rows, LENGTH)[begins::PERIOD])
        if not seen.any():
            return n
        return begins + LENGTH - 1 - (len(rows) - n) + PERIOD * int(seen.argmax())


def _together(windows: Array) -> Flags:
    """Whether enough channels step at the end of each window, shape (m, scans, channels)."""
    seen = _enough(np.abs(MEANS_APART @ windows) > 0.5 * LEAST_STEP_K)
    # Means are cheap, but a spike moves them: medians of those few windows decide.
    if seen.any():
        seen[seen] = _surely(windows[seen])
    return seen


def _surely(windows: Array) -> Flags:
    before = windows[:, :BEFORE]
    middle = np.median(before, axis=1)
    sigma = MAD_SIGMA * np.median(np.abs(before - middle[:, None]), axis=1)
    step = np.abs(np.median(windows[:, BEFORE:], axis=1) - middle)
    return _enough(step > np.maximum(LIMIT * MEDIAN_ERROR * sigma, LEAST_STEP_K))


def _enough(stepped: Flags) -> Flags:
    together: Flags = np.add.reduce(stepped, axis=-1) >= TOGETHER
    return together
