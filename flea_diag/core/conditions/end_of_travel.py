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

"""Watches a stream of scans for contact with the stops at the ends of travel."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from flea_diag.core.conditions.arrival import LOOKS_BACK_S, arrived, still
from flea_diag.core.conditions.contact import Contact, Signs, following, missing_force
from flea_diag.core.residual_values import ResidualRows
from flea_diag.core.residuals.parameters import ActuatorParameters, UnitTolerance
from flea_diag.core.residuals.relation_set import RelationSet
from flea_diag.core.residuals.stop import Stop
from flea_diag.core.row_ring import RowRing
from flea_diag.core.scan_counts import ScanCounts

Array = npt.NDArray[np.float64]
Flags = npt.NDArray[np.bool_]

MOST_SCANS = 2048
"""Most scans of a block."""
STILL_S = 0.1
"""Time over which a part in contact stands, but for a quarter of the width of its end."""
SIGMAS = 3.0
"""Sigmas of another unit's winding beyond which the back-EMF contradicts a standstill."""


class EndOfTravel:
    """State of contact over a stream of scans, constant memory.

    Away from the ends a block is looked at as a whole; near them scan by scan, up to the first
    that changes the state. ``noise_v`` is the sigma of the electrical residual.
    """

    def __init__(
        self,
        known: RelationSet,
        tolerance: UnitTolerance,
        noise_v: float,
        period_s: float,
        counts: ScanCounts,
    ) -> None:
        rows = self._rows = known.residuals
        self._electrical, self._encoder = rows.column(rows.circuit), rows.channel(rows.encoder)
        self._drag = known.functions["drag"]
        self._current = known.signals.index(rows.current) if rows.current in known.signals else None
        self._tolerance, self._noise_v = tolerance, noise_v
        self._period_s, self._settle_s = period_s, counts.kernel * period_s
        self._looks_back, self._still = counts.of(LOOKS_BACK_S), counts.of(STILL_S)
        self.contact = Contact.FREE
        self.unseen: Flags | None = None
        """In which of the last scans no reading shows where the part is, if there are any."""
        self.side = 0
        """End of the contact: -1 lower, 1 upper, 0 none so far."""
        self._elapsed = 0
        self._doubted: set[int] = set()
        self._slowest, self._fastest = -math.inf, math.inf
        self.use(known.stop)

    def use(self, stop: Stop) -> None:
        """Watch the ends of this travel."""
        self.stop = stop
        self._bounds = stop.low_m, stop.high_m, stop.within_m
        self._columns = [self._rows.index[n] for n in stop.channels if n in self._rows.index]
        fixed = ((name, gain) for name, gain in stop.reactions.items() if math.isfinite(gain))
        relation, gain = next(fixed, ("", math.nan))
        self._gain, self._balance = gain, self._rows.column(relation)
        self._watches = stop.known and self._balance >= 0 and bool(self._columns)
        self._recent = RowRing(len(self._columns) + 1, (MOST_SCANS + self._looks_back,))
        self.interrupt()

    def bound(self, low: float, high: float) -> None:
        """Set the range of the encoder: a speed at its limit says that it is at least as fast."""
        self._slowest, self._fastest = low, high

    def interrupt(self) -> None:
        """A gap in the stream: what was read before it says nothing of how it got here."""
        self._recent.store[:] = np.nan

    def step(
        self, p: ActuatorParameters, rows: Array, residuals: ResidualRows, voltage_usable: Flags
    ) -> int:
        """Take n scans; the first that changes the state, or n. Nothing counts from there on."""
        count = len(rows)
        if not self._watches:
            return count
        start = self._recent.place(count)
        taken = self._recent.store[start : start + count]
        near = self._take(rows, p.encoder_m_per_rad or math.nan, taken)
        if self.contact is Contact.FREE and not self._doubted and not near:
            self._elapsed += count
            return count
        recent = self._recent.store[start - self._looks_back : start + count]
        for k in range(count):
            signs = self._signs(
                p, recent[k + 1 : k + 1 + self._looks_back], residuals, voltage_usable, k
            )
            then = following(self.contact, signs)
            self._elapsed += 1
            if then is not self.contact:
                self.contact, self._elapsed = then, 0
                self.side = signs.end or self.side
                return k
        return count

    def _take(self, rows: Array, lead: float, taken: Array) -> bool:
        """Fill in readings and speed of the motor; whether any reading is within an end."""
        if len(rows) > 1:
            readings = rows[:, self._columns]
            missing = np.asarray(np.isnan(readings).all(axis=1))
            self.unseen = missing if missing.any() else None
            taken[:, :-1] = readings
            speeds = rows[:, self._encoder] if self._encoder >= 0 else math.nan
            known = (speeds > self._slowest) & (speeds < self._fastest)
            taken[:, -1] = np.where(known, speeds * lead, math.nan)
            return bool(self._ends(readings).any())
        # One scan is quicker without arrays.
        near, unseen, (low, high, within) = False, True, self._bounds
        for place, column in enumerate(self._columns):
            taken[0, place] = x = rows.item(0, column)
            near |= abs(x - low) <= within or abs(x - high) <= within
            unseen &= x != x
        speed = rows.item(0, self._encoder) if self._encoder >= 0 else math.nan
        taken[0, -1] = speed * lead if self._slowest < speed < self._fastest else math.nan
        self.unseen = np.array([True]) if unseen else None
        return near

    def _ends(self, readings: Array) -> npt.NDArray[np.int64]:
        """-1, 0 or 1 of each reading: which end it is within."""
        stop = self.stop
        low = np.abs(readings - stop.low_m) <= stop.within_m
        return (np.abs(readings - stop.high_m) <= stop.within_m).astype(int) - low

    def _signs(
        self,
        p: ActuatorParameters,
        recent: Array,
        residuals: ResidualRows,
        voltage_usable: Flags,
        k: int,
    ) -> Signs:
        """Evidence of scan k, the last of ``recent``."""
        end, believed = self._believed_end(recent)
        signals = residuals.signals[k].tolist()
        _, dry_n = self._drag(p, signals)
        current = math.nan if self._current is None else signals[self._current]
        circuit = self._electrical
        electrical = float(residuals.values[k, circuit]) if circuit >= 0 else math.nan
        bound = SIGMAS * math.hypot(
            self._tolerance.voltage_offset_v,
            self._tolerance.winding_resistance_ohm * (current - p.current_offset_a),
            self._noise_v,
        )
        reaction = missing_force(
            float(residuals.values[k, self._balance]),
            self._gain,
            end or self.side,
            dry_n,
        )
        last = [recent[-self._still :, c] for c in believed]
        return Signs(
            end,
            still(last, 0.25 * self.stop.within_m),
            reaction,
            bool(voltage_usable[k])
            and abs(electrical) > bound
            and not self._agree(recent[-1, -1], len(believed), p.moving_m_s),
            self._elapsed * self._period_s,
            self._settle_s,
        )

    def _agree(self, motor_m_s: float, believed: int, moving_m_s: float) -> bool:
        """Whether two sensors agree that it stands: one fault does not stop both.

        Pushed against its stop a winding warms faster than predicted, and its drop of voltage
        then reads as a back-EMF.
        """
        if math.isnan(motor_m_s):
            return believed > 1
        return believed > 0 and abs(motor_m_s) <= moving_m_s

    def _believed_end(self, recent: Array) -> tuple[int, list[int]]:
        """The end that all believed channels are near, and these channels."""
        ends = self._ends(recent[-1, :-1]).tolist()
        for column, end in enumerate(ends):
            value = recent[-1, column]
            if not end:
                # A missing reading is no sign that a doubted sensor has left the end.
                if not math.isnan(value):
                    self._doubted.discard(column)
            elif not arrived(recent[:, column], recent[:, -1], self._period_s, self.stop.within_m):
                self._doubted.add(column)
        known = np.flatnonzero(np.isfinite(recent[-1, :-1])).tolist()
        believed = [column for column in known if column not in self._doubted]
        sides = {ends[column] for column in believed}
        return (sides.pop() if len(sides) == 1 else 0), believed
