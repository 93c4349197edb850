"""Memory limits for reading one file: a few compressed bytes can unpack to any size.

``mcap_chunk`` bounds each chunk; this module bounds their sum, and the messages held back where
chunks overlap in time. All files that a command reads share what is granted beyond their sizes.
"""

from __future__ import annotations

import os
from typing import NoReturn

from flea_diag.errors import RecordingError

VARIABLE = "FLEA_BAG_LIMIT_MB"
UNPACKED_MB = 1000
RATIO = 1000
"""Largest compression ratio of a file; recordings of a stand at rest come close to it."""
STORAGE_RATIO = 100
"""The same of an SQLite file, which packs less well and is unpacked onto the disk."""
HELD_BYTES = 128 << 20
MESSAGE_BYTES = 240
"""Memory overhead of a message in addition to its data."""
SMALL_BYTES = 64 << 20
"""Limit for everything except messages: schemas, channels, attachments."""
MEGABYTE = 1_000_000


class _Command:
    """Bytes that all files of a command were granted for their sizes, and have unpacked to."""

    granted = unpacked = 0


_COMMAND = _Command()


def begin_command() -> None:
    """Forget what was read before: a new command begins."""
    _COMMAND.granted = _COMMAND.unpacked = 0


class Budget:
    """Charged by the reader of one file before it unpacks, holds or keeps anything.

    Raises
    ------
    RecordingError
        By every method if a limit is exceeded; the message names the limit.
    """

    def __init__(self, name: str, size_bytes: int, ratio: int = RATIO) -> None:
        self._name = name
        asked = os.environ.get(VARIABLE, "")
        least_mb = int(asked) if asked.isdigit() and len(asked) < 10 else UNPACKED_MB
        self._least = least_mb * MEGABYTE
        self._limit = max(self._least, ratio * size_bytes)
        _COMMAND.granted += ratio * size_bytes
        self._unpacked = self._held = self._small = 0

    def unpack(self, size_bytes: int) -> None:
        """Charge a chunk, message or part of a file before it is unpacked."""
        self._unpacked += size_bytes
        _COMMAND.unpacked += size_bytes
        if self._unpacked > self._limit:
            self._refuse("it unpacks", self._limit)
        together = max(self._least, _COMMAND.granted)
        if _COMMAND.unpacked > together:
            self._refuse("with the files read before it unpacks", together)

    def _refuse(self, what: str, limit: int) -> NoReturn:
        raise RecordingError(
            f"{self._name}: {what} to more than {limit / MEGABYTE:.0f} MB; "
            f"if it is sound, raise the limit: {VARIABLE}=10000"
        )

    def hold(self, data_bytes: int, messages: int = 1) -> None:
        """Charge messages that are held back."""
        self._held += data_bytes + messages * MESSAGE_BYTES
        if self._held > HELD_BYTES:
            raise RecordingError(
                f"{self._name}: messages of more than {HELD_BYTES / MEGABYTE:.0f} MB overlap in "
                "time; rewrite the bag in smaller chunks, in order of log time"
            )

    def release(self, data_bytes: int, messages: int = 1) -> None:
        """Release messages that were held back."""
        self._held -= data_bytes + messages * MESSAGE_BYTES

    def keep(self, size_bytes: int) -> None:
        """Charge a schema, channel or attachment, which is kept while the file is open."""
        self._small += size_bytes
        if self._small > SMALL_BYTES:
            raise RecordingError(
                f"{self._name}: schemas, channels and attachments of more than "
                f"{SMALL_BYTES / MEGABYTE:.0f} MB"
            )
