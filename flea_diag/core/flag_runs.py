"""Runs of neighbouring scans that have a flag in common."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

Flags = npt.NDArray[np.bool_]


def flag_runs(flags: Flags) -> npt.NDArray[np.int64]:
    """First scan of each run and the one after its last, shape (runs, 2)."""
    edges = np.flatnonzero(np.diff(np.concatenate(([False], flags, [False]))))
    return np.asarray(edges.reshape(-1, 2), dtype=np.int64)


def longest_run(flags: Flags) -> int:
    """Number of scans of the longest run; 0 where none has the flag."""
    return int(np.diff(flag_runs(flags)).max(initial=0))
