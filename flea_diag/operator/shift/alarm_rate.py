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

"""How many alarms came how fast: a flood is more than a person can act on (EEMUA 191)."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace

from flea_diag.operator.words import tr

WINDOW_NS = 600_000_000_000
FLOOD = 10
"""Alarms in ten minutes above which one operator is flooded, by EEMUA 191."""
CALM = 5
"""Alarms in ten minutes below which a flood is over, by EEMUA 191."""
SHIFT_NS = 12 * 3600 * 10**9
"""What is counted: the longest shift."""
NS_A_MINUTE = 60 * 10**9


@dataclass(frozen=True, slots=True)
class Flood:
    """A stretch of too many alarms: its first and its last one, and how many there were."""

    since_ns: int
    until_ns: int
    count: int


def of_shift(detected_ns: Iterable[int], until_ns: int) -> tuple[int, ...]:
    """Those of the last shift before a moment."""
    return tuple(sorted(at for at in detected_ns if at > until_ns - SHIFT_NS))


def most_in_a_window(detected_ns: Iterable[int]) -> int:
    """Largest number of alarms within any ten minutes."""
    return max((count for _, count in _windows(sorted(detected_ns))), default=0)


def floods(detected_ns: Iterable[int]) -> tuple[Flood, ...]:
    """From the first alarm of more than ten in ten minutes to the last before fewer than five."""
    stamps = sorted(detected_ns)
    found: list[Flood] = []
    flooded = False
    for last, (first, count) in enumerate(_windows(stamps)):
        if not flooded and count > FLOOD:
            found.append(Flood(stamps[first], stamps[last], count))
        elif flooded and count >= CALM:
            found[-1] = replace(found[-1], until_ns=stamps[last], count=found[-1].count + 1)
        flooded = count >= CALM if flooded else count > FLOOD
    return tuple(found)


def _windows(stamps: list[int]) -> Iterable[tuple[int, int]]:
    """For each alarm the first of the ten minutes that end with it, and how many they hold."""
    first = 0
    for last, stamp_ns in enumerate(stamps):
        while stamp_ns - stamps[first] >= WINDOW_NS:
            first += 1
        yield first, last - first + 1


def rate_text(detected_ns: Iterable[int]) -> str:
    """The largest rate in a sentence, and the floods."""
    stamps = tuple(detected_ns)
    count = most_in_a_window(stamps)
    most = (
        tr("at most one alarm within 10 min")
        if count == 1
        else tr("at most {most} alarms within 10 min", most=count)
    )
    found = floods(stamps)
    if not found:
        return most
    if len(found) == 1:
        return most + tr(": a flood, above {flood}", flood=FLOOD)
    minutes = sum(flood.until_ns - flood.since_ns for flood in found) / NS_A_MINUTE
    told = tr(
        ": {count} floods, above {flood}, together {minutes:.0f} min",
        count=len(found), flood=FLOOD, minutes=minutes,
    )  # fmt: skip
    return most + told
