"""A file that is a sound MCAP at any time, and may still grow.

Most readers refuse an MCAP file that does not end with a footer, which a recorder that is
killed can no longer write. So the end stands ahead: an empty footer (a file without summary, as
the specification allows), and between data and end some room, as a record of an opcode that
readers pass over. What is added goes into that room, and its first bytes last, in place of the
room's own: whenever a kill or a full disk breaks that off, it is still data, room, end. The
room takes no space on the disk, and is gone once the file is finished.
"""

from __future__ import annotations

import os
import struct
from pathlib import Path

MAGIC = b"\x89MCAP0\r\n"
_DATA_END = struct.pack("<BQI", 0x0F, 4, 0)
_FOOTER_WITHOUT_SUMMARY = struct.pack("<BQQQI", 0x02, 20, 0, 0, 0)
PROVISIONAL_END = _DATA_END + _FOOTER_WITHOUT_SUMMARY + MAGIC
ROOM_BYTES = 1 << 20
_ROOM = struct.Struct("<BQ")
_ROOM_OPCODE = 0x80
"""The first of those that the specification leaves to applications."""


class McapFile:
    """Binary stream for mcap's Writer (``write``, ``tell``, ``flush``), on a new file."""

    def __init__(self, path: Path) -> None:
        self._descriptor = os.open(path, os.O_CREAT | os.O_EXCL | os.O_WRONLY, 0o666)
        self._waiting = bytearray()
        self._written = self._end = 0
        self.closed = False

    def write(self, data: bytes) -> int:
        """Append; it waits in memory for the next end."""
        self._waiting += data
        if len(self._waiting) > ROOM_BYTES:
            self._add()
        return len(data)

    def tell(self) -> int:
        """Return the end of the data."""
        return self._written + len(self._waiting)

    def flush(self) -> None:
        """Nothing goes to the disk but with an end."""

    def _add(self) -> None:
        """Put what waits into the room."""
        grown = self._written + len(self._waiting)
        if grown + _ROOM.size > self._end:
            self._make_room(grown + _ROOM.size + ROOM_BYTES)
        added = memoryview(self._waiting + self._room(grown))
        self._put(added[_ROOM.size :], self._written + _ROOM.size)
        self._put(added[: _ROOM.size], self._written)
        self._written = grown
        self._waiting.clear()

    def _make_room(self, end: int) -> None:
        """Let the data go on up to ``end``."""
        self._put(memoryview(PROVISIONAL_END), end)
        self._end = end
        self._put(memoryview(self._room(self._written)), self._written)

    def _room(self, begin: int) -> bytes:
        """Head of the record that fills the file from ``begin`` to its end."""
        return _ROOM.pack(_ROOM_OPCODE, self._end - begin - _ROOM.size)

    def _put(self, data: memoryview, at: int) -> None:
        while data:
            count = os.pwrite(self._descriptor, data, at)
            data, at = data[count:], at + count

    def end_for_now(self) -> None:
        """Put everything on the disk."""
        if self._waiting:
            self._add()
        os.fdatasync(self._descriptor)

    def finish(self) -> None:
        """The Writer has written an end of its own: ours goes, and the room."""
        self.end_for_now()
        os.ftruncate(self._descriptor, self._written)
        os.fdatasync(self._descriptor)

    def close(self) -> None:
        """Close the file."""
        if not self.closed:
            self.closed = True
            os.close(self._descriptor)
