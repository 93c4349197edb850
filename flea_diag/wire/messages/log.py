"""Events as rcl_interfaces/Log, which log panels of viewers list and mark on their timeline."""

from __future__ import annotations

from flea_diag.wire.messages.cdr import CdrWriter
from flea_diag.wire.records import Level

LOG = "rcl_interfaces/msg/Log"

_SEVERITY: dict[Level, int] = {Level.OK: 20, Level.WARN: 30, Level.ERROR: 40, Level.STALE: 30}
"""Level -> INFO, WARN and ERROR of rcl_interfaces/Log."""


def encode_log(stamp_ns: int, level: Level, name: str, text: str) -> bytes:
    """CDR bytes of one event; ``name`` is its source, as the node of a log line.

    Raises
    ------
    WireError
        The stamp or a text cannot be represented.
    """
    writer = CdrWriter(stamp_ns, frame=False)
    writer.u8(_SEVERITY[level])
    for part in (name, text, "", ""):  # file and function of a line of source code
        writer.text(part)
    writer.u32(0)
    return bytes(writer)
