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

"""Limits for reading one file: a few compressed bytes can unpack to any size and number.

``mcap_chunk`` bounds each chunk; this module bounds their sum, the messages held back where
chunks overlap in time, and the time that reading takes. Every file is charged to the budget of
its command, too.
"""

from __future__ import annotations

import time

from flea_diag.errors import RecordingError
from flea_diag.wire.command_budget import LIMITS, MEGABYTE, Quantity, current, least, refuse

STORAGE_RATIO = 100
"""Compression ratio granted to an SQLite file, which packs less well and is unpacked on disk."""
HELD_BYTES = 128 << 20
MESSAGE_BYTES = 240
"""Memory overhead of a message in addition to its data."""
SMALL_BYTES = 64 << 20
"""Limit for everything except messages: schemas, channels, attachments."""


class Budget:
    """Charged by the reader of one file before it unpacks, holds or keeps anything.

    One pass over a file has one budget. CPU time runs from ``resume`` to ``spend``, in this
    thread.

    Raises
    ------
    RecordingError
        By every method if a limit is exceeded; the message names the limit.
    """

    def __init__(self, name: str, size_bytes: int, ratio: float | None = None) -> None:
        self._name = name
        self._command = current()
        self._used = [0.0] * len(LIMITS)
        self._most = [0.0] * len(LIMITS)
        self._held = self._small = 0
        self._from_s = 0.0
        for quantity, limit in zip(Quantity, LIMITS, strict=True):
            granted = size_bytes * limit.per_byte
            if quantity is Quantity.UNPACKED and ratio is not None:
                granted = size_bytes * ratio
            self._most[quantity] = max(least(quantity), granted)
            if self._command is not None:
                self._command.grant(quantity, granted)

    def unpack(self, size_bytes: int) -> None:
        """Charge a chunk, message or part of a file before it is unpacked."""
        self._charge(Quantity.UNPACKED, size_bytes)

    def count(self, messages: int) -> None:
        """Charge messages, or other records of the file."""
        self._charge(Quantity.MESSAGES, messages)

    def resume(self) -> None:
        """Begin to measure the time of this thread."""
        self._from_s = time.thread_time()

    def spend(self) -> None:
        """Charge the time since ``resume`` or the last call."""
        now_s = time.thread_time()
        spent_s, self._from_s = now_s - self._from_s, now_s
        self._charge(Quantity.SECONDS, spent_s)

    def _charge(self, quantity: Quantity, amount: float) -> None:
        self._used[quantity] += amount
        if self._used[quantity] > self._most[quantity]:
            refuse(self._name, quantity, self._most[quantity])
        if self._command is not None:
            self._command.charge(self._name, quantity, amount)

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
