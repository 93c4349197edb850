"""Fields and chunks of an MCAP file, read without believing any size that they announce."""

from __future__ import annotations

import struct
import zlib
from collections.abc import Iterator

from flea_diag.errors import RecordingError

CHUNK_LIMIT_BYTES = 256 << 20
"""A chunk that would unpack to more is refused."""

CHUNK_HEAD = struct.Struct("<QQQI")
U32 = struct.Struct("<I")
U64 = struct.Struct("<Q")


class DamageError(Exception):
    """The bytes contradict the format."""


def text(body: memoryview, place: int) -> tuple[str, int]:
    """Read a string at ``place``, and return where it ends."""
    raw = sized(body, place, U32)
    return raw.decode(), place + 4 + len(raw)


def sized(body: memoryview, place: int, length: struct.Struct) -> bytes:
    """Read bytes at ``place`` that are preceded by their number."""
    (size,) = length.unpack_from(body, place)
    start = place + length.size
    if size > len(body) - start:
        raise DamageError(f"{size} bytes announced where {len(body) - start} are left")
    return bytes(body[start : start + size])


def pairs(body: memoryview) -> Iterator[tuple[str, str]]:
    """Read a map of strings."""
    place = 0
    while place < len(body):
        key, place = text(body, place)
        value, place = text(body, place)
        yield key, value


def chunk_data(body: memoryview, whole: bool = True) -> memoryview:
    """Unpack the records of a chunk, and check them against their checksum.

    Of one that the file's end cuts off (not ``whole``) as much as there is.
    """
    _, _, size, checksum = CHUNK_HEAD.unpack_from(body)
    compression, place = text(body, CHUNK_HEAD.size)
    packed = sized(body, place, U64) if whole else bytes(body[place + U64.size :])
    if size > CHUNK_LIMIT_BYTES:
        raise DamageError(f"it unpacks to {size} bytes, the limit is {CHUNK_LIMIT_BYTES}")
    data = _decompress(compression, packed, size)
    if whole and len(data) != size:
        raise DamageError(f"it unpacks to {len(data)} bytes, {size} were announced")
    if whole and checksum and zlib.crc32(data) != checksum:
        raise DamageError("its checksum is wrong")
    return memoryview(data)


def _decompress(compression: str, packed: bytes, size: int) -> bytes:
    """Unpack without ever making more than ``size`` bytes; less where ``packed`` is cut off."""
    if compression == "":
        return packed[:size]
    try:
        if compression == "zstd":
            return _unzstd(packed, size)
        if compression == "lz4":
            import lz4.frame

            return bytes(lz4.frame.LZ4FrameDecompressor().decompress(packed, max_length=size))
    except ImportError as error:
        raise RecordingError(
            f"a bag packed with {compression} needs the package mcap: pip install mcap ({error})"
        ) from error
    except (RuntimeError, EOFError, ValueError, MemoryError) as error:
        raise DamageError(f"it does not unpack: {error}") from None
    raise DamageError(f"its compression {compression!r} is unknown")


def _unzstd(packed: bytes, size: int) -> bytes:
    import zstandard

    try:
        return bytes(zstandard.ZstdDecompressor().stream_reader(packed).read(size))
    except zstandard.ZstdError as error:
        raise DamageError(f"it does not unpack: {error}") from None
