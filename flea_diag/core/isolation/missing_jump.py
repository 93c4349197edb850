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

"""Errors of a reading that begin at once, held against how far that reading has jumped.

A bias of a sensor and a force that no sensor feels are one and the same in the balance of forces.
At the onset they are not: a bias is a jump of that very reading, and any other disturbance moves
the others. A hypothesis whose jump is missing since long before the detection is contradicted. It
stays where the reading jumps as far in healthy motion: nothing need be known of its noise.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from flea_diag.core.faults.fault import Fault
from flea_diag.core.likelihood.fit import Fit
from flea_diag.core.scan_counts import ScanCounts

Array = npt.NDArray[np.float64]
Stamps = npt.NDArray[np.int64]
Row = Sequence[float]

PIECE_S = 1.0
"""Length of a piece of which the largest jumps are kept."""
PIECES = 60
"""How many are kept: an error came up within a minute, even if the actuator has rested since."""
WATCHED_S = 4.0
"""Time in motion before the detection in which an error came up, as long as the longest window of a
test: what began before that would have been detected, if what told it had a value."""
SEEN_SHARE = 0.9
"""A reading whose jumps range over less than this share of an error has not taken it on: what a
fitted size is off by, is less. An assumption."""
SIGMAS = 2.0
"""Standard errors by which a fitted size may be too large."""
LOST_PERIODS = 2.5
"""Time between two scans, in periods, in which a jump may have gone unseen."""


@dataclass(frozen=True, slots=True)
class Jump:
    """Range of the jumps of a reading, in its unit and as a share of the reading after each.

    Motion may take from the jump of an error, but no more than the reading jumps the other way
    elsewhere: the largest jump up and the largest one down make up the error together. NaN where a
    reading is missing.
    """

    size: float
    share: float


@dataclass(frozen=True, slots=True)
class JumpPiece:
    """Largest jumps up and down, and shares, of some scans; their last stamp.

    ``moving``: scans in motion in which each residual had a value; the last: in motion.
    """

    largest: Array
    until_ns: int
    moving: Array


class JumpMemory:
    """Keeps the largest jumps of the last minute; constant memory.

    ``names``: signals, then the jumps of ``readings`` and, last, whether it moves.
    """

    def __init__(
        self, names: Sequence[str], readings: Sequence[str], residuals: Sequence[str],
        counts: ScanCounts,
    ) -> None:  # fmt: skip
        self._readings = tuple(readings)
        self._columns = {name: column for column, name in enumerate(residuals)}
        self._places = [names.index(name) for name in readings]
        self._jumps = slice(len(names), len(names) + len(readings))
        self._lost_ns = LOST_PERIODS * counts.period_s * 1e9
        self._watched = counts.of(WATCHED_S)
        self._rows = np.empty((counts.of(PIECE_S), len(names) + len(readings) + 2))
        self._values = np.empty((len(self._rows), len(residuals)))
        self._stamps_ns = np.zeros(1 + len(self._rows), dtype=np.int64)
        self._pieces: deque[JumpPiece] = deque(maxlen=PIECES)
        self._count = 0
        self._singly: list[tuple[int, Row, Row]] = []

    def add_scan(self, stamp_ns: int, row: Row, values: Row) -> None:
        """``add`` for one scan, which waits for the others of its piece."""
        if len(row) != self._rows.shape[1] or len(values) != self._values.shape[1]:
            return
        self._singly.append((stamp_ns, row, values))
        if self._count + len(self._singly) == len(self._rows):
            self._take_waiting()

    def _take_waiting(self) -> None:
        if self._singly:
            stamps_ns, rows, values = zip(*self._singly, strict=True)
            self._singly = []
            self.add(stamps_ns, rows, values)

    def add(
        self, stamps_ns: Sequence[int] | Stamps, rows: Sequence[Row] | Array,
        values: Sequence[Row] | Array,
    ) -> None:  # fmt: skip
        """Take regressors and residuals of n >= 1 scans; those of older bags say nothing."""
        self._take_waiting()
        if len(rows[0]) != self._rows.shape[1] or len(values[0]) != self._values.shape[1]:
            return
        if not self._stamps_ns[0]:
            self._stamps_ns[0] = stamps_ns[0]
        start = 0
        while start < len(rows):
            end = min(start + len(self._rows) - self._count, len(rows))
            here = slice(self._count, self._count + end - start)
            self._rows[here], self._stamps_ns[1:][here] = rows[start:end], stamps_ns[start:end]
            self._values[here] = values[start:end]
            start, self._count = end, here.stop
            if self._count == len(self._rows):
                self._pieces.append(self._piece())
                self._stamps_ns[0], self._count = self._stamps_ns[-1], 0

    def _piece(self) -> JumpPiece:
        """What the scans show that wait."""
        rows, stamps_ns = self._rows[: self._count], self._stamps_ns[: self._count + 1]
        jumps, readings = rows[:, self._jumps], rows[:, self._places]
        with np.errstate(divide="ignore", invalid="ignore"):
            shares = jumps / (readings + jumps)
        # One that is not known makes the largest of them unknown.
        largest = np.maximum.reduce(np.stack((jumps, -jumps, shares, -shares)), axis=1)
        if (np.diff(stamps_ns) > self._lost_ns).any():
            largest[:] = np.nan
        known = np.column_stack((~np.isnan(self._values[: self._count]), np.ones(self._count)))
        return JumpPiece(largest, int(stamps_ns[-1]), (rows[:, -1] > 0.5) @ known)

    def largest(self, detected_ns: int, until_ns: int, told: str = "") -> Mapping[str, Jump]:
        """Of each reading the jumps by which an error may have begun until then.

        ``told``: the residual that has deviated first, if one has: while it had no value, the error
        went unseen. None if too little is known before the detection.
        """
        self._take_waiting()
        pieces = [*self._pieces, self._piece()] if self._count else list(self._pieces)
        column = self._columns.get(told, -1)
        before, near = 0.0, len(pieces)
        while near and before < self._watched:
            near -= 1
            before += pieces[near].moving[column] if pieces[near].until_ns <= detected_ns else 0
        if before < self._watched:
            return {}
        end = sum(piece.until_ns <= until_ns for piece in pieces) + 1
        up, down, more, less = np.maximum.reduce([piece.largest for piece in pieces[near:end]])
        rows = zip(self._readings, (up + down).tolist(), (more + less).tolist(), strict=True)
        return {name: Jump(size, share) for name, size, share in rows}


def begins_with_jump(fault: Fault) -> bool:
    """Whether a fault is an error of a reading that is there at once."""
    return fault.mode in ("bias", "scaling") and not fault.incipient


def missing_jump(fault: Fault, fit: Fit | None, jumps: Mapping[str, Jump]) -> str:
    """Why a fault with this fit must have begun with a larger jump; empty: it need not."""
    jump = jumps.get(fault.channel)
    if jump is None or fit is None or not fit.sizes or not begins_with_jump(fault):
        return ""
    size = abs(fit.sizes[0])
    least = SEEN_SHARE * (size - SIGMAS * fit.sigmas[0])
    seen = jump.size if fault.mode == "bias" else jump.share
    if not seen < least:  # nor is one that is not known
        return ""
    return f"the reading has jumped by {seen:.3g} at most, not by {size:.3g}"
