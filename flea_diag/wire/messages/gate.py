"""Checks of every message in addition to its layout, live or from a bag.

Stamps must be after 1970, names of faults must fit a list, and names must be unique: of a channel
twice in one scan the later value would be used, and a healthy stand would appear faulty.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache
from typing import Any

from flea_diag.errors import WireError, shown
from flea_diag.wire import records as r

Names = tuple[str, ...]


@lru_cache(maxsize=256)
def twice(names: Names) -> str:
    """The first name that occurs twice, "" if none does."""
    seen: set[str] = set()
    for name in names:
        if name in seen:
            return name
        seen.add(name)
    return ""


_NAMES: dict[type, tuple[Callable[[Any], Names], ...]] = {
    r.Scan: (lambda scan: scan.channels,),
    r.VibrationBlock: (lambda block: block.axes,),
    r.VibrationLevel: (lambda level: level.axes,),
    r.Residual: (
        lambda residual: residual.names,
        lambda residual: residual.regressor_names,
        lambda residual: residual.estimated,
    ),
    r.ChannelTable: (lambda table: tuple(row.name for row in table.channels),),
    r.DataQuality: (lambda quality: tuple(row.channel for row in quality.channels),),
    r.Symbols: (lambda symbols: tuple(row.residual for row in symbols.symbols),),
    r.Hypotheses: (lambda found: tuple(row.fault for row in (*found.members, *found.dropped)),),
    r.AmbiguityGroup: (lambda group: tuple(row.fault for row in (*group.members, *group.dropped)),),
}
"""Record -> its lists of names, in each of which names must be unique."""

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
        raise WireError(f"stamp {record.stamp_ns} ns is before 1970: set the clock of its source")
    for names_of in _NAMES.get(type(record), ()):
        name = twice(names_of(record))
        if name:
            raise WireError(f"the name {shown(name)} occurs twice, names must be unique")
    for fault in (row.fault for row in getattr(record, "members", ())):
        if not fault or SEPARATOR in fault:
            raise WireError(f"the fault {shown(fault)} is no name: without comma, and not empty")
