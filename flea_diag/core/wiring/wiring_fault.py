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

"""How a channel can be wired wrong, and readings as they would be without it."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from flea_diag.core.frozen import Frozen

Array = npt.NDArray[np.float64]
Flags = npt.NDArray[np.bool_]

TURNED, FACTOR, SWAPPED, LATE, CLIPPED = "turned", "factor", "swapped", "late", "clipped"

FACTORS: Mapping[float, str] = {
    1000.0: "1000",
    1e-3: "1/1000",
    100.0: "100",
    1e-2: "1/100",
    25.4: "25.4 (inch, mm)",
    1.0 / 25.4: "1/25.4 (mm, inch)",
    180.0 / math.pi: "57.3 (degrees, rad)",
    math.pi / 180.0: "1/57.3 (rad, degrees)",
    30.0 / math.pi: "9.55 (rpm, rad/s)",
    math.pi / 30.0: "1/9.55 (rad/s, rpm)",
    2.0 * math.pi: "6.28 (rad, turns)",
    0.5 / math.pi: "1/6.28 (turns, rad)",
    4.4482216: "4.45 (N, lbf)",
    1.0 / 4.4482216: "1/4.45 (lbf, N)",
}
"""By what a mistaken unit multiplies a reading, and in words."""
FLAT = 1e-6
"""Share of its span within which a reading is at its end."""
REMEDIES: Mapping[str, str] = {
    TURNED: "turn its sign where it is read (sign in channels.yaml), or its wires",
    FACTOR: "correct its unit or scale where it is read (unit in channels.yaml)",
    SWAPPED: "exchange the two where they are read, or their plugs",
    LATE: "stamp it when it is measured, or take the delay off its stamps",
    CLIPPED: "send what is commanded, not what is left of it after a limit",
}


@dataclass(frozen=True, slots=True)
class WiringFault(Frozen):
    """One channel as it may be wired wrong.

    ``factor`` is that of a unit, ``scans`` how many it is late, ``other`` the channel that it is
    swapped with, ``ends`` the readings at which it is cut off.
    """

    kind: str
    channel: str
    factor: float = 1.0
    scans: int = 0
    other: str = ""

    @property
    def channels(self) -> tuple[str, ...]:
        """The channels that are wired wrong."""
        return (self.channel, self.other) if self.other else (self.channel,)

    def undone(self, rows: Array, index: Mapping[str, int]) -> Array:
        """Readings without it, shape (n or fewer, channels); what cannot be known is NaN."""
        column = index[self.channel]
        made = rows.copy()
        if self.kind == TURNED:
            made[:, column] *= -1.0
        elif self.kind == FACTOR:
            made[:, column] /= self.factor
        elif self.kind == SWAPPED:
            other = index[self.other]
            made[:, [column, other]] = rows[:, [other, column]]
        elif self.kind == LATE:
            made = made[: len(rows) - self.scans]
            made[:, column] = rows[self.scans :, column]
        else:
            made[at_ends(rows[:, column]), column] = np.nan
        return made

    def silent(self, rows: Array, index: Mapping[str, int]) -> Array:
        """``undone`` with the mean of what is known of the channel in place of its readings."""
        made, column = self.undone(rows, index), index[self.channel]
        known = made[np.isfinite(made[:, column]), column]
        made[:, column] = known.mean() if len(known) else np.nan
        return made

    def words(self, period_s: float) -> str:
        """What is wrong."""
        if self.kind == TURNED:
            return f"{self.channel}: its sign is turned"
        if self.kind == FACTOR:
            return f"{self.channel}: it reads {FACTORS[self.factor]} times what it should"
        if self.kind == SWAPPED:
            return f"{self.channel} and {self.other} are swapped"
        if self.kind == LATE:
            return f"{self.channel}: it comes {1e3 * self.scans * period_s:.0f} ms late"
        return f"{self.channel}: it is cut off at its ends"

    @property
    def remedy(self) -> str:
        """What to do about it."""
        return REMEDIES[self.kind]


def at_ends(values: Array) -> Flags:
    """Which readings are the largest or the smallest of all, shape (n,); one value has no ends."""
    low, high = np.nanmin(values), np.nanmax(values)
    near = FLAT * (high - low)
    return (values >= high - near) | (values <= low + near)
