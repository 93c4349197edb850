"""An MCAP file read front to back, as far as it is whole.

A recorder that was killed leaves a file without footer, summary and index, cut anywhere.
So none of those is relied on: one pass over the record headers finds the chunks (their data
are passed over), a second one reads the messages in log order, holding only chunks that
overlap in time. Every length is checked against the file before it is believed.
Source of the layout: the MCAP specification, version 0.
"""

from __future__ import annotations

import heapq
import struct
import zlib
from collections.abc import Iterator
from pathlib import Path
from typing import IO, NamedTuple

from flea_diag.errors import RecordingError
from flea_diag.wire.mcap_file import MAGIC

CHUNK_LIMIT_BYTES = 256 << 20
"""A chunk that would unpack to more is refused."""

_SCHEMA, _CHANNEL, _MESSAGE, _CHUNK, _ATTACHMENT, _FOOTER = 0x03, 0x04, 0x05, 0x06, 0x09, 0x02
_RECORD = struct.Struct("<BQ")
_MESSAGE_HEAD = struct.Struct("<HIQQ")
_CHUNK_HEAD = struct.Struct("<QQQI")
_U32 = struct.Struct("<I")
_U64 = struct.Struct("<Q")
_SMALL_LIMIT_BYTES = 16 << 20


class Channel(NamedTuple):
    """Topic of a channel, with the message type and encoding."""

    topic: str
    message: str
    encoding: str


class Message(NamedTuple):
    """One message as it lies in the file."""

    log_ns: int
    publish_ns: int
    channel: Channel
    data: bytes


class _Piece(NamedTuple):
    """A chunk, or a message outside any chunk."""

    start_ns: int
    end_ns: int
    offset: int
    size: int
    opcode: int


class _DamageError(Exception):
    """The bytes contradict the format."""


class McapScan:
    """One MCAP file.

    Parameters
    ----------
    path
        The file.

    Attributes
    ----------
    channels
        Channels met so far by their number; complete after ``messages`` has ended.
    complete
        Whether the file ends with its footer.
    losses
        What could not be read, in words.

    Raises
    ------
    RecordingError
        When it cannot be opened or is no MCAP file.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self.channels: dict[int, Channel] = {}
        self.attachments: dict[str, bytes] = {}
        self.losses: list[str] = []
        self.complete = False
        self._schemas: dict[int, str] = {}
        self._pieces: list[_Piece] = []
        try:
            self._size = path.stat().st_size
            with path.open("rb") as stream:
                self._find_pieces(stream)
                self._find_channels(stream)
        except OSError as error:
            raise RecordingError(f"cannot read {path}: {error.strerror or error}") from error

    def _find_pieces(self, stream: IO[bytes]) -> None:
        if stream.read(len(MAGIC)) != MAGIC:
            raise RecordingError(f"{self.path} is no MCAP file: it does not start with its magic")
        while not self.complete:
            offset = stream.tell()
            head = stream.read(_RECORD.size)
            opcode, size = _RECORD.unpack(head) if len(head) == _RECORD.size else (0, 0)
            if not opcode or size > self._size - stream.tell():
                lost = self._size - offset
                self.losses.append(
                    f"{self.path.name}: no footer, the file ends at byte {self._size}"
                    + (f" within a record; {lost} bytes lost" if lost else "")
                )
                return
            try:
                self._note(stream, opcode, size)
            except (_DamageError, struct.error, UnicodeDecodeError) as error:
                self.losses.append(f"{self.path.name}: record at byte {offset} lost: {error}")
            stream.seek(offset + _RECORD.size + size)

    def _note(self, stream: IO[bytes], opcode: int, size: int) -> None:
        offset = stream.tell()
        if opcode == _CHUNK:
            start_ns, end_ns, _, _ = _CHUNK_HEAD.unpack(stream.read(_CHUNK_HEAD.size))
            self._pieces.append(_Piece(start_ns, end_ns, offset, size, opcode))
        elif opcode == _MESSAGE:
            _, _, log_ns, _ = _MESSAGE_HEAD.unpack(stream.read(_MESSAGE_HEAD.size))
            self._pieces.append(_Piece(log_ns, log_ns, offset, size, opcode))
        elif opcode in (_SCHEMA, _CHANNEL, _ATTACHMENT):
            if size > _SMALL_LIMIT_BYTES:
                raise _DamageError(f"{size} bytes, the limit is {_SMALL_LIMIT_BYTES}")
            self._define(opcode, memoryview(stream.read(size)))
        elif opcode == _FOOTER:
            self.complete = True

    def _find_channels(self, stream: IO[bytes]) -> None:
        """Channels of a file without summary stand inside the chunks: look there."""
        if self.channels and self.complete:
            return
        for piece in self._pieces:
            if piece.opcode == _CHUNK:
                for _ in self._unpacked(stream, piece, quiet=True):
                    pass

    def _define(self, opcode: int, body: memoryview) -> None:
        if opcode == _SCHEMA:
            (number,) = struct.unpack_from("<H", body)
            self._schemas[number] = _text(body, 2)[0]
        elif opcode == _CHANNEL:
            number, schema = struct.unpack_from("<HH", body)
            topic, place = _text(body, 4)
            encoding, _ = _text(body, place)
            self.channels[number] = Channel(topic, self._schemas.get(schema, ""), encoding)
        elif opcode == _ATTACHMENT:
            name, place = _text(body, 16)
            _, place = _text(body, place)
            (size,) = _U64.unpack_from(body, place)
            self.attachments[name] = bytes(body[place + 8 : place + 8 + size])

    def messages(self) -> Iterator[Message]:
        """All messages in order of log time; equal times keep their order in the file."""
        waiting: list[tuple[int, int, int, Message]] = []
        with self.path.open("rb") as stream:
            for piece in sorted(self._pieces, key=lambda piece: (piece.start_ns, piece.offset)):
                while waiting and waiting[0][0] < piece.start_ns:
                    yield heapq.heappop(waiting)[-1]
                for number, message in enumerate(self._unpacked(stream, piece)):
                    heapq.heappush(waiting, (message.log_ns, piece.offset, number, message))
        while waiting:
            yield heapq.heappop(waiting)[-1]

    def _unpacked(self, stream: IO[bytes], piece: _Piece, quiet: bool = False) -> Iterator[Message]:
        stream.seek(piece.offset)
        data = memoryview(stream.read(piece.size))
        try:
            if piece.opcode == _MESSAGE:
                yield self._message(data)
            else:
                yield from self._records(_chunk_data(data))
        except (_DamageError, struct.error, UnicodeDecodeError, IndexError) as error:
            if not quiet:
                self.losses.append(f"{self.path.name}: rest of chunk at {piece.offset}: {error}")

    def _records(self, data: memoryview) -> Iterator[Message]:
        place = 0
        while place < len(data):
            opcode, size = _RECORD.unpack_from(data, place)
            place += _RECORD.size
            if size > len(data) - place:
                raise _DamageError(f"a record of {size} bytes where {len(data) - place} are left")
            body = data[place : place + size]
            place += size
            if opcode == _MESSAGE:
                yield self._message(body)
            else:
                self._define(opcode, body)

    def _message(self, body: memoryview) -> Message:
        number, _, log_ns, publish_ns = _MESSAGE_HEAD.unpack_from(body)
        channel = self.channels.get(number)
        if channel is None:
            raise _DamageError(f"a message on channel {number}, which is not defined")
        return Message(log_ns, publish_ns, channel, bytes(body[_MESSAGE_HEAD.size :]))


def _text(body: memoryview, place: int) -> tuple[str, int]:
    (size,) = _U32.unpack_from(body, place)
    end = place + 4 + size
    if end > len(body):
        raise _DamageError(f"a text of {size} bytes where {len(body) - place - 4} are left")
    return bytes(body[place + 4 : end]).decode(), end


def _chunk_data(body: memoryview) -> memoryview:
    _, _, size, checksum = _CHUNK_HEAD.unpack_from(body)
    compression, place = _text(body, _CHUNK_HEAD.size)
    (packed_size,) = _U64.unpack_from(body, place)
    packed = body[place + 8 : place + 8 + packed_size]
    if size > CHUNK_LIMIT_BYTES:
        raise _DamageError(f"it unpacks to {size} bytes, the limit is {CHUNK_LIMIT_BYTES}")
    data = _decompress(compression, packed, size)
    if len(data) != size:
        raise _DamageError(f"it unpacks to {len(data)} bytes, {size} were announced")
    if checksum and zlib.crc32(data) != checksum:
        raise _DamageError("its checksum is wrong")
    return memoryview(data)


def _decompress(compression: str, packed: memoryview, size: int) -> bytes | memoryview:
    """Unpack without ever making more than ``size`` bytes."""
    if compression == "":
        return packed
    try:
        if compression == "zstd":
            return _unzstd(packed, size)
        if compression == "lz4":
            import lz4.frame

            return bytes(lz4.frame.LZ4FrameDecompressor().decompress(packed, max_length=size))
    except (RuntimeError, EOFError, ValueError, MemoryError) as error:
        raise _DamageError(f"it does not unpack: {error}") from None
    raise _DamageError(f"its compression {compression!r} is unknown")


def _unzstd(packed: memoryview, size: int) -> bytes:
    import zstandard

    try:
        announced = zstandard.frame_content_size(packed)
        if announced > size:
            raise _DamageError(f"it unpacks to {announced} bytes, {size} were announced")
        return bytes(zstandard.ZstdDecompressor().decompress(packed, max_output_size=size))
    except zstandard.ZstdError as error:
        raise _DamageError(f"it does not unpack: {error}") from None
