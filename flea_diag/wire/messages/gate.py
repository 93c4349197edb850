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

"""Checks of every message in addition to its layout, live or from a bag.

Stamps must be after 1970, names of faults must fit a list, and names must be unique: of a channel
twice in one scan the later value would be used, and a healthy stand would appear faulty.
"""

from __future__ import annotations

from collections.abc import Callable
from operator import attrgetter
from typing import Any

from flea_diag.errors import WireError, shown
from flea_diag.wire import records as r

Names = tuple[str, ...]


MOST_KNOWN = 256
_known: dict[int, Names] = {}
"""Lists of names in which each is unique, by identity: a stream repeats the very same list."""


def twice(names: Names) -> str:
    """The first name that occurs twice, "" if none does."""
    if _known.get(id(names)) is names:
        return ""
    seen: set[str] = set()
    for name in names:
        if name in seen:
            return name
        seen.add(name)
    if len(_known) >= MOST_KNOWN:
        _known.clear()
    _known[id(names)] = names
    return ""


_NAMES: dict[type, tuple[Callable[[Any], Names], ...]] = {
    r.Scan: (attrgetter("channels"),),
    r.VibrationBlock: (attrgetter("axes"),),
    r.VibrationLevel: (attrgetter("axes"),),
    r.VerdictNumbers: (attrgetter("names"),),
    r.Residual: tuple(map(attrgetter, ("names", "regressor_names", "estimated"))),
    r.ChannelTable: (lambda table: tuple(row.name for row in table.channels),),
    r.DataQuality: (lambda quality: tuple(row.channel for row in quality.channels),),
    r.Symbols: (lambda symbols: tuple(row.residual for row in symbols.symbols),),
    r.Hypotheses: (lambda found: tuple(row.fault for row in (*found.members, *found.dropped)),),
    r.AmbiguityGroup: (lambda group: tuple(row.fault for row in (*group.members, *group.dropped)),),
}
"""Record -> its lists of names, in each of which names must be unique."""

_JUDGEMENTS = (r.AmbiguityGroup, r.Hypotheses)
SEPARATOR = ", "
"""Not in the name of a fault: it separates the names in a list of members."""


def check(record: Any) -> None:
    """Refuse an inconsistent record.

    Raises
    ------
    WireError
        A stamp or name is invalid; the message names it.
    """
    if record.stamp_ns < 0:
        words = f"stamp {record.stamp_ns} ns is before 1970: set the clock of its source"
        raise WireError(words, "stamp")
    kind = type(record)
    for names_of in _NAMES.get(kind, ()):
        name = twice(names_of(record))
        if name:
            words = f"the name {shown(name)} occurs twice, names must be unique"
            raise WireError(words, "names")
    if kind in _JUDGEMENTS:
        _check_faults(record)


def _check_faults(record: Any) -> None:
    for fault in (row.fault for row in record.members):
        if not fault or SEPARATOR in fault:
            words = f"the fault {shown(fault)} is no name: without comma, and not empty"
            raise WireError(words, "names")
