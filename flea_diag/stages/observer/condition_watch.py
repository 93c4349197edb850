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

"""Conditions that void relations on one stream of scans: what holds now, and since when.

Judged here are the end of travel and the saturated drive; ``voltage_trust`` and ``speed_trust``
judge conditions of their own. Contact holds from the scan that shows it, so a block ends before
that scan.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from flea_diag.core.calibration.calibration import Calibration
from flea_diag.core.conditions.bounding import Bounding
from flea_diag.core.conditions.clipped import ClippedReadings
from flea_diag.core.conditions.condition import NAMED
from flea_diag.core.conditions.contact import LONGEST_S, Contact
from flea_diag.core.conditions.end_of_travel import EndOfTravel
from flea_diag.core.conditions.lingering import Lingering
from flea_diag.core.frozen import Frozen
from flea_diag.core.residual_values import ResidualRows
from flea_diag.core.residuals.parameters import ActuatorParameters
from flea_diag.core.residuals.relation_set import RelationSet
from flea_diag.wire.records import (
    END_OF_TRAVEL,
    NEVER_NS,
    ChannelQuality,
    ChannelTable,
    Quality,
)

Array = npt.NDArray[np.float64]
Flags = npt.NDArray[np.bool_]
Stamps = npt.NDArray[np.int64]

SIDES = {-1: "lower", 1: "upper"}
SAID = (Contact.HELD, Contact.LEAVING, Contact.OVERDUE)
"""States that are reported once there was contact."""
UNKNOWN = (
    "ends unknown: the description states no travel and no position channel a range, so a run "
    "into a stop is taken for a fault; add travel to the actuator description"
)
UNSEEN = (
    "ends not observable: no position channel of the moved part, so a run into a stop is taken "
    "for a fault"
)


def at_limit(values: Array, low: float, high: float) -> list[bool]:
    """Which values are at a limit of their range; not those that are missing."""
    if len(values) == 1:
        value = values.item(0)
        return [value <= low or value >= high]
    limited: list[bool] = ((values <= low) | (values >= high)).tolist()
    return limited


@dataclass(frozen=True, slots=True)
class Voided(Frozen):
    """A condition that has just begun: its words, what it voids, how old an alarm it takes back.

    ``excludes``: column and magnitude of the symbols that it cannot have caused.
    """

    words: str
    columns: frozenset[int]
    takes_back_s: float
    excludes: frozenset[tuple[int, str]] = frozenset()


class ConditionWatch:
    """The conditions of one stream."""

    def __init__(self, calibration: Calibration, relations: RelationSet) -> None:
        c = calibration
        self._rows = relations.residuals
        limit = c.limit(self._rows.circuit)
        self._commanded = self._rows.channel(self._rows.command)
        self._stop = relations.stop
        self._columns = NAMED[END_OF_TRAVEL].columns(relations)
        self._travel = EndOfTravel(
            relations,
            c.tolerance,
            limit.sigma[0] if limit is not None else 0.0,
            c.period_s,
            c.counts,
        )
        self._command = NAMED["saturated_drive"].columns(relations)
        self._saturated = Lingering(c.counts.kernel)
        bounding = Bounding(relations, c.parameters)
        self._clipped = ClippedReadings(self._rows, c.counts.kernel, bounding)
        self._range = -math.inf, math.inf
        self._void_drive: Flags | None = None
        self._voids = self._held = False
        self._since_ns = NEVER_NS
        self.told = False
        """Whether the last scan has changed what is reported."""
        self.begins: Voided | None = None
        """The condition that began with the last scan."""

    def take_ranges(self, table: ChannelTable) -> None:
        """Take ends that the description does not state from the ranges of a channel table."""
        ranges = {row.name: (row.minimum, row.maximum) for row in table.channels}
        stop = self._stop.within(ranges)
        if stop != self._travel.stop:
            self._travel.use(stop)
        self._travel.bound(*ranges.get(self._rows.encoder, (-math.inf, math.inf)))
        self._range = ranges.get(self._rows.command, self._range)
        self._clipped.use(ranges)

    def interrupt(self) -> None:
        """There is a gap before the next scan."""
        self._travel.interrupt()

    def step(
        self,
        p: ActuatorParameters,
        stamps_ns: Stamps,
        rows: Array,
        residuals: ResidualRows,
        voltage_usable: Flags,
        away: Flags | None = None,
    ) -> int:
        """Take n scans; the first that changes the state, or n.

        ``away``, shape (n,): where the actuator has run away; None: nowhere.
        """
        if self._commanded >= 0:
            at_end = at_limit(rows[:, self._commanded], *self._range)
            self._void_drive = self._saturated.step(at_end)
        turn = self._travel.step(p, rows, residuals, voltage_usable)
        contact, said = self._travel.contact, self._since_ns
        at_stop = contact not in (Contact.FREE, Contact.OVERDUE)
        self._clipped.step(rows, at_stop if away is None or at_stop else away)
        self.begins = None
        if turn < len(rows):
            begins = contact is Contact.HELD and said == NEVER_NS
            self.begins = self._contact() if begins else None
            self._since_ns = int(stamps_ns[turn]) if begins else said
            self._since_ns = self._since_ns if contact in SAID else NEVER_NS
        self.told = turn < len(rows) and (self._since_ns != said or contact is Contact.OVERDUE)
        if turn == len(rows) or len(rows) == 1:
            self._voids, self._held = contact.voids, contact is Contact.HELD
        return turn

    @property
    def voids(self) -> bool:
        """Whether the balances of the stopped part and the state observer are void."""
        return self._voids

    def leave_out(self, residuals: ResidualRows) -> None:
        """Drop what is void; a part that its stop holds does not stand against a drag.

        Where no reading shows where the part is, its stop may hold it.
        """
        if self._voids:
            residuals.leave_out(np.ones(len(residuals), dtype=bool), self._columns)
        unseen = self._travel.unseen
        if unseen is not None and len(unseen) == len(residuals):
            residuals.leave_out(unseen, self._columns)
        if self._held:
            residuals.moving[:] = False
        self._clipped.leave_out(residuals)
        if self._void_drive is not None and len(self._void_drive) == len(residuals):
            residuals.leave_out(self._void_drive, self._command)

    def states(self) -> tuple[ChannelQuality, ...]:
        """The row of DataQuality: contact, or that its ends cannot be known."""
        stop = self._travel.stop
        if not stop.known:
            words = UNSEEN if stop.low_m < stop.high_m else UNKNOWN
            return (ChannelQuality(END_OF_TRAVEL, Quality.ABSENT, 0, words),)
        if self._since_ns == NEVER_NS:
            return ()
        words = self._place()
        if self._travel.contact is Contact.OVERDUE:
            words += f" for more than {LONGEST_S:g} s: all relations tested again"
        else:
            names = ", ".join(self._rows.rows[j].name for j in self._columns)
            words += f": {names} and the state observer not tested"
        return (ChannelQuality(END_OF_TRAVEL, Quality.SATURATED, self._since_ns, words),)

    def _place(self) -> str:
        """Which end of travel it is at."""
        stop = self._travel.stop
        end_m = stop.low_m if self._travel.side < 0 else stop.high_m
        return f"at the {SIDES[self._travel.side]} end of its travel ({end_m:g} m)"

    def _contact(self) -> Voided:
        """What contact voids: the balances of the stopped part, and the state observer."""
        columns = frozenset((*self._columns, *self._rows.columns(self._rows.innovations)))
        never = self._travel.stop.contradicts(self._travel.side)
        excludes = frozenset((self._rows.place[name], sign) for name, sign in never.items())
        return Voided(self._place(), columns, NAMED[END_OF_TRAVEL].takes_back_s, excludes)
