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

    def add_message(self, head: bytes, offset: int, size: int) -> None:
        """Append a message whose record begins at ``offset`` to the run before it, or another."""
        _, _, log_ns, _ = MESSAGE_HEAD.unpack(head)
        last = self[-1] if self else None
        follows = last is not None and (last.opcode, last.offset + last.size) == (MESSAGE, offset)
        if last is None or not follows or last.size + size > RUN_BYTES:
            self._add(Piece(log_ns, log_ns, offset, size, MESSAGE))
            return
        span_ns = min(last.start_ns, log_ns), max(last.end_ns, log_ns)
        self[-1] = Piece(*span_ns, last.offset, last.size + size, MESSAGE)

    def _add(self, piece: Piece) -> None:
        if len(self) == MOST_PIECES:
            raise RecordingError(
                f"more than {MOST_PIECES} chunks in one file: rewrite the bag in larger chunks"
            )
        self.append(piece)
