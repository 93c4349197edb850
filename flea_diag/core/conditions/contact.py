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

"""Contact with the stop at an end of travel, from evidence of its own.

A part is held by its stop where it reads near the end and got there by moving, where it stands,
and where its balance misses a force that pushes it back from the end. A jam holds both ways, and
before the end, too. The back-EMF contradicts a position that only seems to stand.

Contact is known some scans after the impact, so relations are void from the arrival near an end
on, for ``TRIED_S`` at most unless contact follows; then until the part has left the stop, for
``LONGEST_S`` at most, and for one smoothing kernel after.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from enum import Enum

from flea_diag.core.frozen import Frozen

TRIED_S = 0.5
"""Time after the arrival near an end within which contact shows, if there is any."""
LONGEST_S = 60.0
"""Longest time for which contact is an excuse."""
TAKES_BACK_S = 2.0
"""Time after an alarm within which contact takes it back: it begins to miss the reaction up to a
second before it comes near the end, contact shows up to ``TRIED_S`` later, and it takes a moment to
stand. An alarm that is older has had its evidence elsewhere."""
PUSH = 2.0
"""Missing force, in dry frictions, that is the reaction of a stop: less than a push that moves
any healthy screw (``residual.STALL``), more than friction at rest may hold."""


class Contact(Enum):
    """State of the moved part relative to its stops."""

    FREE = "away from the ends"
    ARRIVING = "near an end, contact not yet excluded"
    NEAR = "near an end, not in contact"
    HELD = "in contact"
    LEAVING = "has just left the stop"
    OVERDUE = "in contact for longer than excused"

    @property
    def voids(self) -> bool:
        """Whether relations with the reaction of the stop are void."""
        return self in (Contact.ARRIVING, Contact.HELD, Contact.LEAVING)


@dataclass(frozen=True, slots=True)
class Signs(Frozen):
    """Evidence of one scan.

    ``end``: -1 near the lower end, 1 near the upper, 0 elsewhere or not to be believed.
    ``still``: the readings stand. ``reaction``: force that the balance misses, in dry frictions,
    positive where it pushes back from the end; NaN where unknown. ``turns``: the back-EMF
    contradicts that it stands. ``elapsed_s``: since the state began. ``settle_s``: length of the
    smoothing kernel.
    """

    end: int
    still: bool
    reaction: float
    turns: bool
    elapsed_s: float
    settle_s: float


def _near(s: Signs) -> bool:
    return s.end != 0


def _away(s: Signs) -> bool:
    return s.end == 0


def _held(s: Signs) -> bool:
    return s.end != 0 and s.still and s.reaction > PUSH and not s.turns


def _freed(s: Signs) -> bool:
    """It has left the end, turns, or stands although it is pushed away from the end."""
    return s.end == 0 or s.turns or (s.still and s.reaction < -PUSH)


def _tried(s: Signs) -> bool:
    return s.elapsed_s >= TRIED_S


def _settled(s: Signs) -> bool:
    return s.elapsed_s >= s.settle_s


def _overdue(s: Signs) -> bool:
    return s.elapsed_s >= LONGEST_S


TURNS: Mapping[Contact, tuple[tuple[Callable[[Signs], bool], Contact], ...]] = {
    Contact.FREE: ((_near, Contact.ARRIVING),),
    Contact.ARRIVING: (
        (_held, Contact.HELD),
        (_away, Contact.LEAVING),
        (_tried, Contact.NEAR),
    ),
    Contact.NEAR: ((_held, Contact.HELD), (_away, Contact.FREE)),
    Contact.HELD: ((_freed, Contact.LEAVING), (_overdue, Contact.OVERDUE)),
    Contact.LEAVING: ((_held, Contact.HELD), (_settled, Contact.NEAR)),
    Contact.OVERDUE: ((_freed, Contact.LEAVING),),
}
"""State -> evidence that ends it, in this order, and the state that follows."""


def following(state: Contact, signs: Signs) -> Contact:
    """The state after one more scan."""
    return next((then for ends, then in TURNS[state] if ends(signs)), state)


def missing_force(residual: float, gain: float, end: int, dry_n: float) -> float:
    """Reaction of the stop at an end, in dry frictions, that zeroes a residual of this gain."""
    if not dry_n > 0.0:
        return math.nan
    return -end * residual / (gain * dry_n)
