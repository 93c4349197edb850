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

"""What an observer that comes back in mid-run takes over from the last verdict."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import NamedTuple

from flea_diag.wire.records import AmbiguityGroup, ChannelTable, UnitOffset

MOST_TOLERANCES = 100.0
"""Tolerances of a healthy unit by which no zero of any unit is off: such a record is damaged."""


class Takeover(NamedTuple):
    """Offsets of this unit that are known, and the episode that is open (0: none)."""

    offsets: tuple[UnitOffset, ...]
    episode: int
    opened_ns: int


def takeover(
    verdict: AmbiguityGroup | None,
    table: ChannelTable | None,
    first_ns: int | None,
    tolerances: Mapping[str, float],
) -> Takeover | None:
    """What the verdict holds of this run from before its first scan here; None for nothing.

    The channel table marks the start of the run: what is older belongs to another one. Zeros that
    no unit has are not taken: ``tolerances`` are those of healthy units.
    """
    if verdict is None or table is None or first_ns is None:
        return None
    past = range(table.stamp_ns, first_ns)
    offsets = tuple(
        offset
        for offset in verdict.offsets
        if offset.learned_ns in past and is_possible(offset, tolerances)
    )
    episode = verdict.episode if verdict.detected_stamp_ns in past else 0
    return Takeover(offsets, episode, verdict.detected_stamp_ns) if offsets or episode else None


def is_possible(offset: UnitOffset, tolerances: Mapping[str, float]) -> bool:
    """Whether any unit may have this zero."""
    most = MOST_TOLERANCES * tolerances.get(offset.parameter, 0.0)
    return math.isfinite(offset.sigma) and offset.sigma >= 0.0 and abs(offset.value) <= most
