"""What every message must hold besides its layout, whichever way it came: live or from a bag.

A stamp is after 1970, and a name stands once: of a channel that came twice in one scan the later
value would win, and a sound stand would look broken.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache
from typing import Any

from flea_diag.errors import WireError
from flea_diag.wire import records as r

Names = tuple[str, ...]


@lru_cache(maxsize=256)
def twice(names: Names) -> str:
    """The first name that stands twice among these, "" where none does."""
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
    r.AmbiguityGroup: (lambda group: tuple(row.fault for row in (*group.members, *group.dropped)),),
}
"""Record -> its lists of names, each of which stands once."""


def check(record: Any) -> None:
    """Refuse a record that contradicts itself.

    Raises
    ------
    WireError
        Naming what is wrong.
    """
    if record.stamp_ns < 0:
        raise WireError(f"stamp {record.stamp_ns} ns is before 1970: set the clock of its source")
    for names_of in _NAMES.get(type(record), ()):
        name = twice(names_of(record))
        if name:
            raise WireError(f"the name {name[:80]!r} stands twice, each may stand once")
