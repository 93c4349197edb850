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

"""Reads an MCAP file from front to back, as far as it is intact.

A killed recorder leaves a file without footer, summary and index, truncated anywhere. The reader
therefore uses none of them: a first pass over the record headers finds the chunks (their data are
skipped), a second one reads the messages in log order, holding only chunks that overlap in time.
Every length is checked against the size of the file before use.
Source of the layout: the MCAP specification, version 0.
"""

from __future__ import annotations

import os
import struct
from collections.abc import Iterator
from itertools import chain, count
from pathlib import Path
from typing import IO

from flea_diag.errors import RecordingError
from flea_diag.wire.bags.budget import Budget
from flea_diag.wire.bags.mcap_chunk import (
    CHUNK_HEAD,
    U32,
    U64,
    DamageError,
    chunk_data,
    pairs,
    sized,
    text,
)
from flea_diag.wire.bags.mcap_file import MAGIC
from flea_diag.wire.bags.mcap_message import Channel, McapMessage, Schema, Waiting
from flea_diag.wire.bags.mcap_piece import (
    CHUNK,
    MESSAGE,
    MESSAGE_HEAD,
    PIECE_LIMIT_BYTES,
    RECORD,
    RUN_BYTES,
    Piece,
    Pieces,
)
from flea_diag.wire.bags.message_run import run_of_alike
from flea_diag.wire.regular_file import opened

_HEADER, _FOOTER, _SCHEMA, _CHANNEL, _ATTACHMENT = 1, 2, 3, 4, 9
AT_ONCE = 256
"""Records that are charged to the budget together; one by one is measurably slower."""
_SMALL = (_SCHEMA, _CHANNEL, _ATTACHMENT)
"""Records that are kept as long as the file is open, also where they stand inside a chunk."""
_SMALL_LIMIT_BYTES = 16 << 20
MOST_LOSSES = 1000
"""Losses that are described one by one."""


class McapScan:
    """One MCAP file.

    Parameters
    ----------
    path
        The file.

    Attributes
    ----------
    channels
        Channels found so far, by number; complete after ``messages`` has ended.
    complete, indexed
        Whether the file ends with a footer, and whether the footer refers to a summary.
    profile
        Profile of the header, ``ros2`` for a bag.
    attachments
        Attached files, by name.
    losses
        Descriptions of unreadable parts.

    Raises
    ------
    RecordingError
        The file cannot be opened or is not an MCAP file.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self.channels: dict[int, Channel] = {}
        self.attachments: dict[str, bytes] = {}
        self.losses: list[str] = []
        self.complete = False
        self.indexed = False
        self.profile = ""
        self._schemas: dict[int, Schema] = {}
        self._pieces = Pieces()
        try:
            with opened(path) as stream:
                self._size = os.fstat(stream.fileno()).st_size
                self._begin_pass()
                self._find_pieces(stream)
                self._find_channels(stream)
        except OSError as error:
            raise RecordingError(f"cannot read {path}: {error.strerror or error}") from error

    def _lose(self, words: str) -> None:
        if len(self.losses) < MOST_LOSSES:
            self.losses.append(f"{self.path.name}: {words}")
        elif len(self.losses) == MOST_LOSSES:
            self.losses.append(f"{self.path.name}: more than {MOST_LOSSES} losses, not listed")

    def _begin_pass(self) -> None:
        self._budget = Budget(self.path.name, self._size)
        self._budget.resume()

    def _find_pieces(self, stream: IO[bytes]) -> None:
        if stream.read(len(MAGIC)) != MAGIC:
            raise RecordingError(f"{self.path} is not an MCAP file: wrong magic bytes at its start")
        for number in count():
            if number % AT_ONCE == 0:
                self._budget.spend()
            offset = stream.tell()
            head = stream.read(RECORD.size)
            opcode, size = RECORD.unpack(head) if len(head) == RECORD.size else (0, 0)
            if not opcode or size > self._size - stream.tell():
                self._cut_off(stream, opcode, offset)
                return
            if opcode == MESSAGE and (run := self._note_run(stream, offset)):
                stream.seek(offset + run)
                continue
            try:
                self._note(stream, opcode, size)
            except (DamageError, struct.error, UnicodeDecodeError) as error:
                self._lose(f"record at byte {offset} lost: {error}")
            if self.complete:
                return
            stream.seek(offset + RECORD.size + size)

    def _cut_off(self, stream: IO[bytes], opcode: int, offset: int) -> None:
        """Report that the file is truncated; part of a truncated chunk can be recovered."""
        words = f"no footer, the file ends at byte {self._size}"
        if offset == self._size:
            self._lose(words)
            return
        self._lose(f"{words} within a record that begins at byte {offset}")
        start, left = stream.tell(), self._size - stream.tell()
        if opcode == CHUNK and left > CHUNK_HEAD.size:
            size = min(left, PIECE_LIMIT_BYTES)
            self._pieces.add_chunk(stream.read(CHUNK_HEAD.size), start, size, whole=False)

    def _note_run(self, stream: IO[bytes], offset: int) -> int:
        """Note messages outside of chunks together; their size, 0 where not even one is whole."""
        stream.seek(offset)
        run = self._pieces.add_run(memoryview(stream.read(RUN_BYTES)), offset)
        stream.seek(offset + RECORD.size)
        return run

    def _note(self, stream: IO[bytes], opcode: int, size: int) -> None:
        offset = stream.tell()
        if opcode in (CHUNK, MESSAGE) and size > PIECE_LIMIT_BYTES:
            raise DamageError(f"{size} bytes, the limit is {PIECE_LIMIT_BYTES}")
        if opcode == CHUNK:
            self._pieces.add_chunk(stream.read(CHUNK_HEAD.size), offset, size)
        elif opcode == MESSAGE:
            head = stream.read(MESSAGE_HEAD.size)
            self._pieces.add_message(head, offset - RECORD.size, RECORD.size + size)
        elif opcode in _SMALL:
            self._check_small(size)
            self._define(opcode, memoryview(stream.read(size)))
        elif opcode == _FOOTER:
            self.complete = True
            self.indexed = U64.unpack(stream.read(U64.size)) != (0,)
        elif opcode == _HEADER:
            self.profile, _ = text(memoryview(stream.read(min(size, _SMALL_LIMIT_BYTES))), 0)

    def _check_small(self, size: int) -> None:
        if size > _SMALL_LIMIT_BYTES:
            raise DamageError(f"{size} bytes, the limit is {_SMALL_LIMIT_BYTES}")
        self._budget.keep(size)

    def _find_channels(self, stream: IO[bytes]) -> None:
        """Find the channels of a file without summary: they are defined inside the chunks."""
        if self.channels and self.complete:
            return
        for piece in self._pieces:
            if piece.opcode == CHUNK:
                for _ in self._unpacked(stream, piece, definitions=True):
                    pass
                self._budget.spend()

    def _define(self, opcode: int, body: memoryview) -> None:
        if opcode == _SCHEMA:
            (number,) = struct.unpack_from("<H", body)
            name, place = text(body, 2)
            encoding, place = text(body, place)
            self._schemas[number] = Schema(name, encoding, sized(body, place, U32))
        elif opcode == _CHANNEL:
            number, schema_number = struct.unpack_from("<HH", body)
            topic, place = text(body, 4)
            encoding, place = text(body, place)
            metadata = tuple(pairs(memoryview(sized(body, place, U32))))
            schema = self._schemas.get(schema_number, Schema("", "", b""))
            self.channels[number] = Channel(topic, schema.name, encoding, schema, metadata)
        elif opcode == _ATTACHMENT:
            name, place = text(body, 16)
            _, place = text(body, place)
            self.attachments[name] = sized(body, place, U64)

    def messages(self) -> Iterator[McapMessage]:
        """All messages in order of log time; see ``together``."""
        return chain.from_iterable(self.together())

    def together(self) -> Iterator[list[McapMessage]]:
        """All messages in order of log time; equal times keep their order in the file.

        Those that stand in one piece of the file are together, as far as no other overlaps it.

        Raises
        ------
        RecordingError
            The file unpacks to, or holds at one time, more than its budget, or is gone.
        """
        self._begin_pass()
        try:
            yield from self._ordered()
        except OSError as error:
            raise RecordingError(f"cannot read {self.path}: {error.strerror or error}") from error

    def _ordered(self) -> Iterator[list[McapMessage]]:
        waiting = Waiting(self._budget)
        pieces = sorted(self._pieces, key=lambda piece: (piece.start_ns, piece.offset))
        with opened(self.path) as stream:
            for piece in pieces:
                # Messages older than all later pieces are due; the others wait for those pieces.
                yield from waiting.before(piece.start_ns)
                unpacked = self._unpacked(stream, piece)
                self._budget.resume()
                messages: list[McapMessage] = []
                while part := _some(unpacked):
                    self._budget.count(len(part))
                    waiting.hold(part)
                    messages += part
                waiting.add(messages)
                self._budget.spend()
        yield from waiting.before(None)

    def _unpacked(
        self, stream: IO[bytes], piece: Piece, definitions: bool = False
    ) -> Iterator[list[McapMessage]]:
        """Messages; none, and nothing of damage yet, where ``definitions`` alone are wanted."""
        stream.seek(piece.offset)
        data = memoryview(stream.read(piece.size))
        try:
            if piece.opcode == MESSAGE:
                yield from self._run(data, piece.offset)
            else:
                raw = chunk_data(data, self._budget, piece.whole)
                yield from self._records(raw, definitions)
        except (DamageError, struct.error, UnicodeDecodeError, IndexError) as error:
            if piece.whole and not definitions:
                self._lose(f"rest of chunk at {piece.offset}: {error}")

    def _run(self, data: memoryview, offset: int) -> Iterator[list[McapMessage]]:
        """Messages outside of chunks; one that cannot be read loses no other."""
        raw, place = bytes(data), 0
        while place < len(raw):
            _, size = RECORD.unpack_from(raw, place)
            begin, place = place + RECORD.size, place + RECORD.size + size
            try:
                yield [self._message(raw, begin, place)]
            except (DamageError, struct.error) as error:
                self._lose(f"message at {offset + begin}: {error}")

    def _records(self, raw: bytes, definitions: bool) -> Iterator[list[McapMessage]]:
        data = memoryview(raw)  # a piece of bytes is copied once, of a view twice
        place = passed_over = 0
        end, head, opened = len(raw), RECORD.size, RECORD.unpack_from
        while place < end:
            opcode, size = opened(raw, place)
            begin = place + head
            place = begin + size
            if place > end:
                raise DamageError(f"record of {size} bytes announced, {end - begin} left")
            if opcode == MESSAGE:
                if not definitions:
                    run = run_of_alike(raw, begin - head, place, self.channels)
                    yield run or [self._message(raw, begin, place)]
                    place += max(len(run) - 1, 0) * (place - begin + head)
                continue
            passed_over += 1
            if passed_over % AT_ONCE == 0:
                self._budget.count(AT_ONCE)
            if opcode in _SMALL:
                self._check_small(size)
                self._define(opcode, data[begin:place])

    def _message(self, raw: bytes, begin: int, end: int) -> McapMessage:
        data = begin + MESSAGE_HEAD.size
        if data > end:
            raise DamageError(f"message of {end - begin} bytes, its head has {MESSAGE_HEAD.size}")
        number, _, log_ns, publish_ns = MESSAGE_HEAD.unpack_from(raw, begin)
        channel = self.channels.get(number)
        if channel is None:
            raise DamageError(f"message on undefined channel {number}")
        return McapMessage(log_ns, publish_ns, channel, raw[data:end])


def _some(lists: Iterator[list[McapMessage]]) -> list[McapMessage]:
    """At least ``AT_ONCE`` of what is left."""
    some: list[McapMessage] = []
    for each in lists:
        some += each
        if len(some) >= AT_ONCE:
            break
    return some
