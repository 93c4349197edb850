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

"""Fields and chunks of an MCAP file; every announced size is checked before use."""

from __future__ import annotations

import struct
import zlib
from collections.abc import Iterator

from flea_diag.errors import RecordingError, shown
from flea_diag.wire.bags.budget import Budget

CHUNK_LIMIT_BYTES = 64 << 20
"""Largest uncompressed size of a chunk. Writers start another after about a megabyte or after a
single message, and no message of ours may be larger."""

CHUNK_HEAD = struct.Struct("<QQQI")
U32 = struct.Struct("<I")
U64 = struct.Struct("<Q")


class DamageError(Exception):
    """The bytes contradict the format."""


def text(body: memoryview, place: int) -> tuple[str, int]:
    """String at ``place``, and the position after it."""
    raw = sized(body, place, U32)
    return raw.decode(), place + 4 + len(raw)


def sized(body: memoryview, place: int, length: struct.Struct) -> bytes:
    """Bytes at ``place`` that are preceded by their length."""
    (size,) = length.unpack_from(body, place)
    start = place + length.size
    if size > len(body) - start:
        raise DamageError(f"{size} bytes announced where {len(body) - start} are left")
    return bytes(body[start : start + size])


def pairs(body: memoryview) -> Iterator[tuple[str, str]]:
    """Entries of a map of strings."""
    place = 0
    while place < len(body):
        key, place = text(body, place)
        value, place = text(body, place)
        yield key, value


def chunk_data(body: memoryview, budget: Budget, whole: bool = True) -> bytes:
    """Uncompressed records of a chunk, verified by their checksum.

    Of a chunk truncated by the end of the file (not ``whole``), as much as is available.

    Raises
    ------
    DamageError
        The chunk contradicts the format or is above its own limit.
    RecordingError
        The file is above its budget.
    """
    _, _, size, checksum = CHUNK_HEAD.unpack_from(body)
    compression, place = text(body, CHUNK_HEAD.size)
    packed = sized(body, place, U64) if whole else bytes(body[place + U64.size :])
    if size > CHUNK_LIMIT_BYTES:
        raise DamageError(f"uncompressed size {size} bytes, the limit is {CHUNK_LIMIT_BYTES}")
    budget.unpack(size)
    data = _decompress(compression, packed, size)
    if whole and len(data) != size:
        raise DamageError(f"{len(data)} bytes after decompression, {size} announced")
    if whole and checksum and zlib.crc32(data) != checksum:
        raise DamageError("wrong checksum")
    return data


def _decompress(compression: str, packed: bytes, size: int) -> bytes:
    """Decompress to at most ``size`` bytes; fewer if ``packed`` is truncated."""
    if compression == "":
        return packed[:size]
    try:
        if compression == "zstd":
            return unzstd(packed, size)
        if compression == "lz4":
            import lz4.frame

            return bytes(lz4.frame.LZ4FrameDecompressor().decompress(packed, max_length=size))
    except ImportError as error:
        raise RecordingError(
            f"a bag compressed with {compression} needs the package mcap: pip install mcap "
            f"({error})"
        ) from error
    except (RuntimeError, EOFError, ValueError, MemoryError) as error:
        raise DamageError(f"cannot be decompressed: {error}") from None
    raise DamageError(f"unknown compression {shown(compression)}")


def unzstd(packed: bytes, size: int) -> bytes:
    """Unpack to at most ``size`` bytes.

    Raises
    ------
    DamageError
        This is not zstd.
    """
    import zstandard

    try:
        return bytes(zstandard.ZstdDecompressor().stream_reader(packed).read(size))
    except zstandard.ZstdError as error:
        raise DamageError(f"cannot be decompressed: {error}") from None
