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

"""Angles that begin anew after each turn."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]

TURNS = (2.0 * math.pi, 360.0, 1.0)
"""A turn in rad, degrees and revolutions."""
NEAR = 0.1
"""Share of a turn by which a jump may be smaller or larger, for the motion in between."""
SMOOTH = 0.1
"""Largest other step, as a share of a turn."""


def turn_of(values: Array) -> float:
    """The turn after which an angle begins anew; 0 if it does not."""
    finite = values[np.isfinite(values)]
    if len(finite) < 10:
        return 0.0
    span = float(np.ptp(finite))
    steps = np.abs(np.diff(finite))
    for turn in TURNS:
        if not 0.8 * turn < span <= 1.001 * turn:
            continue
        jumps = steps > (1.0 - NEAR) * turn
        if jumps.any() and float(steps[~jumps].max(initial=0.0)) < SMOOTH * turn:
            return turn
    return 0.0


def unwrapped(values: Array, turn: float) -> Array:
    """The angle without its jumps; NaN stay."""
    found = np.array(values, dtype=np.float64)
    finite = np.isfinite(found)
    found[finite] = np.unwrap(found[finite], period=turn)
    return found
