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

"""Modes of the machine on one stream of scans: which ones hold now, since when, what they void.

A block ends before the scan with which a mode begins or ends.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from flea_diag.core.machine_modes import IN, OUT, UNKNOWN, ModeRow
from flea_diag.core.residuals.residual_rows import ResidualSet
from flea_diag.wire.records import MODE, NEVER_NS, ChannelQuality, Quality

States = npt.NDArray[np.int8]
Stamps = npt.NDArray[np.int64]


class ModeWatch:
    """State of the modes of one stream."""

    def __init__(self, known: ResidualSet) -> None:
        self._known, self._rows = known, known.modes
        self._now: tuple[int, ...] = ()
        self._since_ns = NEVER_NS
        self.told = False
        """Whether the last scan has changed what is reported."""

    def step(self, stamps_ns: Stamps, states: States) -> int:
        """Take n scans, states of shape (n, modes); the first that changes one, or n."""
        if not self._rows:
            return len(stamps_ns)
        changed = (states != np.array(self._now or -1)).any(axis=1)
        turn = int(changed.argmax()) if changed.any() else len(stamps_ns)
        self.told = turn < len(stamps_ns)
        if turn == 0:
            self._since_ns = int(stamps_ns[0])
        if turn == len(stamps_ns) or len(stamps_ns) == 1:
            self._now = tuple(states[-1].tolist())
        return turn

    @property
    def voids(self) -> bool:
        """Whether something is not tested for a mode."""
        return bool(self._now) and (
            any(row.voids for row, state in self._each() if state != OUT)
            or any(row.only for row, state in self._each() if state != IN)
        )

    @property
    def lost(self) -> bool:
        """Whether the equations of motion do not hold."""
        return bool(self._now) and any(
            not row.followed for row, state in self._each() if state != OUT
        )

    @property
    def words(self) -> str:
        """Names of the modes that hold or are unknown; empty: none."""
        said = {IN: "{}", UNKNOWN: "{} or not, for its channel is not read"}
        return ", ".join(said[state].format(r.name) for r, state in self._each() if state != OUT)

    def states(self) -> tuple[ChannelQuality, ...]:
        """The row of DataQuality: the modes, and what is not tested in them."""
        if not self._now:
            return ()
        void = [j for row, state in self._each() if state != OUT for j in row.voids]
        void += [j for row, state in self._each() if state != IN for j in row.only]
        names = [self._known.rows[j].name for j in dict.fromkeys(void)]
        names += ["the state observer"] if self.lost and self._known.innovations else []
        follows = f": {', '.join(names)} not tested" if names and self.words else ""
        return (ChannelQuality(MODE, Quality.GOOD, self._since_ns, self.words + follows),)

    def _each(self) -> zip[tuple[ModeRow, int]]:
        return zip(self._rows, self._now, strict=False)  # no state before the first scan
