"""A file that can be ended for now: it is a sound MCAP at once, and may still grow.

Most readers refuse an MCAP file that does not end with a footer, which a recorder that is
killed can no longer write. So the end is written ahead: an empty footer (a file without
summary, as the specification allows) is put behind the data and cut off again before the
next byte is written.
"""

from __future__ import annotations

import os
import struct
from pathlib import Path

MAGIC = b"\x89MCAP0\r\n"
_DATA_END = struct.pack("<BQI", 0x0F, 4, 0)
_FOOTER_WITHOUT_SUMMARY = struct.pack("<BQQQI", 0x02, 20, 0, 0, 0)
PROVISIONAL_END = _DATA_END + _FOOTER_WITHOUT_SUMMARY + MAGIC


class McapFile:
    """Binary stream for mcap's Writer (``write``, ``tell``, ``flush``), on a new file."""

    def __init__(self, path: Path) -> None:
        self._stream = path.open("xb")
        self._data_end: int | None = None

    @property
    def closed(self) -> bool:
        """Whether the file is closed."""
        return self._stream.closed

    def write(self, data: bytes) -> int:
        """Append, in place of a provisional end."""
        if self._data_end is not None and data:
            self._stream.seek(self._data_end)
            self._stream.truncate()
            self._data_end = None
        return self._stream.write(data)

    def tell(self) -> int:
        """Return the end of the data."""
        return self._stream.tell() if self._data_end is None else self._data_end

    def flush(self) -> None:
        """Hand everything to the operating system."""
        self._stream.flush()

    def end_for_now(self) -> None:
        """Make the file a sound MCAP as it stands, and put it on the disk."""
        if self._data_end is None:
            self._data_end = self._stream.tell()
            self._stream.write(PROVISIONAL_END)
        self.sync()

    def sync(self) -> None:
        """Put everything on the disk."""
        self._stream.flush()
        os.fdatasync(self._stream.fileno())

    def close(self) -> None:
        """Close the file."""
        self._stream.close()
