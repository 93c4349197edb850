"""``level_shift.LevelShift.step`` as a loop, for numba to compile: the same bits as in numpy."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]
Flags = npt.NDArray[np.bool_]
Counts = npt.NDArray[np.int64]


def shift_loops(
    values: Array, use: Flags, store: Array, end: int, windows: Counts,
    reach: tuple[int, int], frozen: Array, is_frozen: bool, last: Array, shifts: Array,
) -> tuple[int, bool]:  # fmt: skip
    """Scan after scan; returns the end of the sums and whether the earlier level is still frozen.

    ``reach``: most and fewest samples of that level. ``store`` has room for all of the scans.
    """
    most, least = reach
    for i in range(len(values)):
        if math.isnan(values[i, 0]):
            end, is_frozen = 1, False
            store[0], last[:] = 0.0, math.nan
        elif use[i]:
            store[end] = store[end - 1] + values[i]
            for w in range(len(windows)):
                begin = end - windows[w]
                near, far, samples = max(begin, 0), max(begin - most, 0), min(begin, most)
                known = begin >= 0 if is_frozen else samples >= least
                for c in range(values.shape[1]):
                    earlier = math.nan
                    if is_frozen:
                        earlier = frozen[w, c]
                    elif known:
                        earlier = (store[near, c] - store[far, c]) / samples
                    mean = (store[end, c] - store[near, c]) / windows[w]
                    last[w, c] = mean - earlier if known else math.nan
            end += 1
        shifts[i] = last
    return end, is_frozen
