"""How much one file may make its reader unpack and hold: a few bytes can unpack to anything.

Each chunk is bounded by itself (``mcap_chunk``); this bounds their sum, and what waits for its
turn where chunks overlap in time.
"""

from __future__ import annotations

import os

from flea_diag.errors import RecordingError

VARIABLE = "FLEA_BAG_LIMIT_MB"
UNPACKED_MB = 1000
RATIO = 1000
"""Bytes that a byte of the file may stand for: a recording of a stand at rest packs that well."""
HELD_BYTES = 128 << 20
MESSAGE_BYTES = 240
"""What a message takes in memory beside its data."""
SMALL_BYTES = 64 << 20
"""All that is no message: schemas, channels, attachments."""
MEGABYTE = 1_000_000


class Budget:
    """Spent by the reader of one file before it unpacks, holds or keeps anything.

    Raises
    ------
    RecordingError
        From every method, when the limit is passed; it names the limit and how to raise it.
    """

    def __init__(self, name: str, size_bytes: int) -> None:
        self._name = name
        asked = os.environ.get(VARIABLE, "")
        least_mb = int(asked) if asked.isdigit() and len(asked) < 10 else UNPACKED_MB
        self._limit = max(least_mb * MEGABYTE, RATIO * size_bytes)
        self._unpacked = self._held = self._small = 0

    def unpack(self, size_bytes: int) -> None:
        """A chunk is about to be unpacked."""
        self._unpacked += size_bytes
        if self._unpacked > self._limit:
            raise RecordingError(
                f"{self._name}: its chunks unpack to more than {self._limit / MEGABYTE:.0f} MB; "
                f"if it is sound, raise the limit: {VARIABLE}=10000"
            )

    def hold(self, data_bytes: int) -> None:
        """A message waits for its turn."""
        self._held += data_bytes + MESSAGE_BYTES
        if self._held > HELD_BYTES:
            raise RecordingError(
                f"{self._name}: messages of more than {HELD_BYTES / MEGABYTE:.0f} MB overlap in "
                "time; write the bag anew in smaller chunks, in order of log time"
            )

    def release(self, data_bytes: int) -> None:
        """A message has had its turn."""
        self._held -= data_bytes + MESSAGE_BYTES

    def keep(self, size_bytes: int) -> None:
        """A schema, channel or attachment is kept as long as the file is open."""
        self._small += size_bytes
        if self._small > SMALL_BYTES:
            raise RecordingError(
                f"{self._name}: schemas, channels and attachments of more than "
                f"{SMALL_BYTES / MEGABYTE:.0f} MB"
            )
