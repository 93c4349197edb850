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

"""Deviations as qualitative symbols: magnitude first, then slope.

The magnitude of a residual is the sign with which its test first passed its limit in this
episode, and it stays. The slope is decided ``SLOPE_S`` later, or as soon after that as the same
test is the one nearest to its limit again: a Z-test of the mean then against the mean at the
crossing (variance 2 sigma^2 of the windowed mean), 0 where they do not differ, or by a small share
of what is there: a jump of a hundred sigmas that wanders by a tenth is no rise. Sigmas of
different tests are different units: a mean over 4 s counts many more of them than one over
0.5 s, and would rise or fall where nothing does. Nor is the balance that holds the friction held
against itself from another direction of motion, or from a standstill against a push, where the
friction may be anything up to the dry friction (``one_way``). (Narasimhan et al. 2010, 3.1: an
ordered set of two symbols 0, +, -.)
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

from flea_diag.core.frozen import Frozen

UNKNOWN = "?"
ANY = "*"
"""Magnitude of a residual whose coefficient on a reading has shifted: its sign is that of a fault
only while current, voltage and speed have the sides that they mostly had."""
SLOPE_S = 2.0  # after the paper
SLOPE_LIMIT = 3.0 * 2.0**0.5
"""Limit of the change in sigmas of one mean: three sigmas of a difference of two."""

SLOPE_SHARE = 0.25
"""Share of the deviation by which it must change to rise or fall. What a relation neglects grows
with the deviation, which its noise does not. Chosen on three position errors of 29 to 103 times
their limit that wandered by 5 to 15 %, beside the jams and drifts of Table 4, which stay."""

Test = tuple[float, float, float]
"""Key of a test of one residual: samples of the window, limit in standard deviations, and the
direction of motion, 0 where the residual does not depend on it."""
MIXED = math.nan
"""In place of the direction where the window holds several, or a standstill against a push."""


@dataclass(frozen=True, slots=True)
class SymbolState(Frozen):
    """Symbols of one residual; ``z`` is the test statistic at the crossing, of this ``test``."""

    magnitude: str
    slope: str
    since_ns: int
    z: float
    test: Test


def crossed(z: float, test: Test, stamp_ns: int, signed: bool = True) -> SymbolState:
    """State of a residual that has just passed the limit of this test, ``signed`` or not."""
    sign = "+" if z > 0 else "-"
    return SymbolState(sign if signed else ANY, UNKNOWN, stamp_ns, z, test)


def later(state: SymbolState, z: float, test: Test, stamp_ns: int) -> SymbolState:
    """The same residual at a later scan: its slope once enough time has passed."""
    if (
        state.magnitude == ANY
        or state.slope != UNKNOWN
        or stamp_ns - state.since_ns < SLOPE_S * 1e9
    ):
        return state
    if z != z or test != state.test or math.isnan(test[2]):
        return state
    change = z - state.z
    same = max(SLOPE_LIMIT, SLOPE_SHARE * abs(state.z))
    slope = "0" if abs(change) <= same else "+" if change > 0 else "-"
    return replace(state, slope=slope)
