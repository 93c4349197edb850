# Copyright 2026 flea_diag maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""Runs of neighbouring scans that have a flag in common."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

Flags = npt.NDArray[np.bool_]
Counts = npt.NDArray[np.int64]


def flag_runs(flags: Flags) -> Counts:
    """First scan of each run and the one after its last, shape (runs, 2)."""
    edges = np.flatnonzero(np.diff(np.concatenate(([False], flags, [False]))))
    return np.asarray(edges.reshape(-1, 2), dtype=np.int64)


def longest_run(flags: Flags) -> int:
    """Number of scans of the longest run; 0 where none has the flag."""
    return int(np.diff(flag_runs(flags)).max(initial=0))


def in_a_row(counted: Flags, over: Flags, begun: int = 0) -> Counts:
    """How many of the counted scans there have been since one with which it was over, (n,)."""
    counts = begun + np.cumsum(counted)
    return np.asarray(counts - np.maximum.accumulate(np.where(over, counts, 0)))
