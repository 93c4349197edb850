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

"""A second publisher that says the same names on a topic: its messages jump away and back."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from flea_diag.errors import RecordingError

Array = npt.NDArray[np.float64]
Flags = npt.NDArray[np.bool_]

FEWEST_MESSAGES = 100
LARGE = 8.0
"""Jump, in usual differences between every second message, that is none of a motion."""
TOGETHER = 2
"""Fields of a message that must jump together: a sensor that fails has one."""
LEAST, MOST = 0.01, 0.45
"""Shares of the messages that another publisher has."""
IN_TURNS = 0.8
"""Share of the messages that jump away and back where two publish at one rate."""
TURNS = (
    "two publishers of the same fields take turns: nothing tells which one is meant; end one, or "
    "give it another topic"
)
EVEN, REGULAR = 0.3, 0.8
"""Deviation from whole steps, and share of the steps within it, of a publisher of its own rate."""


def second_publisher(stamps_s: Array, values: Array) -> Flags:
    """Messages of a topic that another publisher sent at a rate of its own, shape (n,).

    Parameters
    ----------
    stamps_s
        Time of each message, shape (n,).
    values
        Its fields, shape (n, fields); NaN where it has none.

    Raises
    ------
    RecordingError
        Two publish at the same rate: neither is the other one.
    """
    none = np.zeros(len(stamps_s), dtype=bool)
    if len(stamps_s) < FEWEST_MESSAGES or values.shape[1] < TOGETHER:
        return none
    found = none.copy()
    found[1:-1] = _away_and_back(values)
    share = float(found.mean())
    if share > IN_TURNS:
        raise RecordingError(TURNS)
    if not LEAST <= share <= MOST or not _is_regular(stamps_s[found]):
        return none
    return found


def _away_and_back(values: Array) -> Flags:
    """Which messages but the first and the last jump away from both that are beside them."""
    across = np.abs(values[2:] - values[:-2])
    usual = np.nanmedian(np.where(np.isfinite(across), across, 0.0), axis=0)
    away = np.minimum(np.abs(values[1:-1] - values[:-2]), np.abs(values[1:-1] - values[2:]))
    with np.errstate(invalid="ignore"):
        jumps = (away > LARGE * usual) & (away > across) & (usual > 0.0)
    many: Flags = jumps.sum(axis=1) >= TOGETHER
    return many


def _is_regular(stamps_s: Array) -> bool:
    """Whether messages come at a rate of their own, but for those that were not told."""
    steps = np.diff(stamps_s)
    steps = steps[steps > 0.0]
    if len(steps) < 5:
        return False
    turns = steps / float(np.median(steps))
    return float(np.mean(np.abs(turns - np.round(turns)) < EVEN)) >= REGULAR
