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

"""Parts of an MCAP file that hold messages: chunks, and runs of messages outside of chunks."""

from __future__ import annotations

import struct
from typing import NamedTuple

from flea_diag.errors import RecordingError
from flea_diag.wire.bags.mcap_chunk import CHUNK_HEAD, CHUNK_LIMIT_BYTES

CHUNK, MESSAGE = 6, 5
RECORD = struct.Struct("<BQ")
"""Opcode and size, before each record."""
MESSAGE_HEAD = struct.Struct("<HIQQ")
_MESSAGE = struct.Struct("<BQHIQ")
"""Both, up to the log time."""
PIECE_LIMIT_BYTES = CHUNK_LIMIT_BYTES + (1 << 20)
"""Largest chunk as stored: incompressible data grow a little."""
RUN_BYTES = 1 << 16
"""Messages outside of chunks are read together up to this size."""
MOST_PIECES = 1_000_000
"""All of them are known before the first message is read."""


class Piece(NamedTuple):
    """A chunk without its opcode and size, or a run of messages with them.

    ``whole`` is False for a chunk that the end of the file cuts.
    """

    start_ns: int
    end_ns: int
    offset: int
    size: int
    opcode: int
    whole: bool = True


class Pieces(list[Piece]):
    """Pieces in the order of the file.

    Raises
    ------
    RecordingError
        There are more than ``MOST_PIECES``.
    """

    def add_chunk(self, head: bytes, offset: int, size: int, whole: bool = True) -> None:
        """Append a chunk that begins at ``offset``."""
        start_ns, end_ns, _, _ = CHUNK_HEAD.unpack(head)
        self._add(Piece(start_ns, end_ns, offset, size, CHUNK, whole))

    def add_run(self, data: memoryview, offset: int) -> int:
        """Append the messages at the start of ``data``; their size, 0 where there is none whole."""
        place = start_ns = end_ns = 0
        last, size_of = len(data) - _MESSAGE.size, RECORD.size
        while place <= last:
            opcode, size, _, _, log_ns = _MESSAGE.unpack_from(data, place)
            if opcode != MESSAGE or size < MESSAGE_HEAD.size or size > len(data) - place - size_of:
                break
            start_ns = min(start_ns, log_ns) if place else log_ns
            end_ns = max(end_ns, log_ns)
            place += size_of + size
        if place:
            self._add(Piece(start_ns, end_ns, offset, place, MESSAGE))
        return place

    def add_message(self, head: bytes, offset: int, size: int) -> None:
        """Append a message whose record begins at ``offset``, a run of its own."""
        _, _, log_ns, _ = MESSAGE_HEAD.unpack(head)
        self._add(Piece(log_ns, log_ns, offset, size, MESSAGE))

    def _add(self, piece: Piece) -> None:
        if len(self) == MOST_PIECES:
            raise RecordingError(
                f"more than {MOST_PIECES} chunks in one file: rewrite the bag in larger chunks"
            )
        self.append(piece)
