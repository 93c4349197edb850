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

"""A growing file that is a valid MCAP file at any time.

Most readers refuse an MCAP file without a footer, which a killed recorder can no longer write.
Therefore the end is written ahead: an empty footer (a file without summary, as the specification
allows) and, between data and footer, reserved space in the form of one record with an opcode that
readers skip. New data are written into the reserved space, their first bytes last, replacing the
head of that record. Whenever this is interrupted by a kill or a full disk, the file still
consists of data, reserved space and footer. The reserved space is sparse (takes no disk space)
and is removed when the file is finished.
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
"""The first opcode that the specification leaves to applications."""


class McapFile:
    """Binary stream for mcap's Writer (``write``, ``tell``, ``flush``), on a new file."""

    def __init__(self, path: Path) -> None:
        self._descriptor = os.open(path, os.O_CREAT | os.O_EXCL | os.O_WRONLY, 0o666)
        self._waiting = bytearray()
        self._written = self._end = 0
        self.closed = False

    def write(self, data: bytes) -> int:
        """Append to a buffer in memory, written by the next ``end_for_now``."""
        self._waiting += data
        if len(self._waiting) > ROOM_BYTES:
            self._add()
        return len(data)

    def tell(self) -> int:
        """Position of the end of the data."""
        return self._written + len(self._waiting)

    def flush(self) -> None:
        """Do nothing: data are written only together with an end of file."""

    def _add(self) -> None:
        """Write the buffer into the reserved space."""
        grown = self._written + len(self._waiting)
        if grown + _ROOM.size > self._end:
            self._make_room(grown + _ROOM.size + ROOM_BYTES)
        added = memoryview(self._waiting + self._room(grown))
        self._put(added[_ROOM.size :], self._written + _ROOM.size)
        self._put(added[: _ROOM.size], self._written)
        self._written = grown
        self._waiting.clear()

    def _make_room(self, end: int) -> None:
        """Extend the reserved space so that data fit up to ``end``."""
        self._put(memoryview(PROVISIONAL_END), end)
        self._end = end
        self._put(memoryview(self._room(self._written)), self._written)

    def _room(self, begin: int) -> bytes:
        """Head of the reserved record from ``begin`` to the end of the file."""
        return _ROOM.pack(_ROOM_OPCODE, self._end - begin - _ROOM.size)

    def _put(self, data: memoryview, at: int) -> None:
        while data:
            count = os.pwrite(self._descriptor, data, at)
            data, at = data[count:], at + count

    def end_for_now(self) -> None:
        """Flush everything to disk."""
        if self._waiting:
            self._add()
        os.fdatasync(self._descriptor)

    def gone(self, path: Path) -> str:
        """What has happened to the file at its place: removed, replaced, truncated, or nothing."""
        own = os.fstat(self._descriptor)
        try:
            found = path.lstat()
        except FileNotFoundError:
            return "removed"
        if (found.st_dev, found.st_ino) != (own.st_dev, own.st_ino):
            return "replaced"
        return "truncated" if own.st_size < self._end else ""

    def finish(self) -> None:
        """Remove reserved space and provisional footer: the Writer has written the final end."""
        self.end_for_now()
        os.ftruncate(self._descriptor, self._written)
        os.fdatasync(self._descriptor)

    def close(self) -> None:
        """Close the file."""
        if not self.closed:
            self.closed = True
            os.close(self._descriptor)
