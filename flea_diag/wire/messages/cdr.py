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

"""Common Data Representation, little endian: the subset needed for the three message types.

Plain CDR (XCDR version 1, OMG formal/2002-06-51 chapter 15), as every ROS 2 middleware and
rosbag2 write it: four bytes of encapsulation, then each primitive aligned to its own size,
counted from the end of the encapsulation; a string is a uint32 length that includes its
closing zero, the bytes and the zero. Reading checks every length against the available bytes
before anything is allocated, so memory is bounded by the size of the input.
"""

from __future__ import annotations

import struct
from collections import deque
from functools import lru_cache
from typing import NoReturn

from flea_diag.errors import WireError, shown
from flea_diag.wire.vocabulary import SECOND_NS

ENCAPSULATION = b"\x00\x01\x00\x00"
"""CDR, little endian, no options."""

_U32 = struct.Struct("<I")
STAMP = struct.Struct("<iI")
_SECONDS = range(-(2**31), 2**31)
TRAILING = 16
"""Largest number of bytes after a message: rclpy 7.1 appends 8 unset bytes to a JointState, since
it estimates the size with an alignment that an empty sequence does not have."""

KEPT_TEXT = 100
"""Longest string whose bytes are cached, characters."""
KEPT_BYTES = 1 << 16
"""Largest sequence of strings that is cached."""
_KEPT: deque[tuple[bytes, tuple[str, ...]]] = deque(maxlen=8)
"""Cache of recent sequences of strings: a stream repeats its names in every message."""


def stamp_bytes(stamp_ns: int) -> bytes:
    """``builtin_interfaces/Time`` of a stamp in ns; WireError beyond its 32 bits of seconds."""
    seconds, nanoseconds = divmod(int(stamp_ns), SECOND_NS)
    if seconds not in _SECONDS:
        raise WireError(
            f"stamp {stamp_ns} ns does not fit a message: its seconds must lie in "
            f"{_SECONDS.start} to {_SECONDS.stop - 1}"
        )
    return STAMP.pack(seconds, nanoseconds)


def text_bytes(value: str) -> bytes:
    """UTF-8 bytes of a string without zero characters and lone surrogates."""
    try:
        raw = value.encode()
    except UnicodeEncodeError as error:
        raise WireError(f"text {shown(value)} cannot be written as UTF-8: {error.reason}") from None
    if b"\0" in raw:
        raise WireError(f"text {shown(value)} contains a zero character, which would truncate it")
    return raw


def _text(value: str) -> bytes:
    """A string as it is written, from its length on."""
    raw = text_bytes(value)
    return b"%b%b\0" % (_U32.pack(len(raw) + 1), raw)


_kept_text = lru_cache(maxsize=4096)(_text)
"""The same of short ones: what is repeated each second says mostly the same."""


class CdrWriter:
    """Writes one message; ``bytes()`` of it includes the encapsulation."""

    __slots__ = ("_body",)

    def __init__(self, stamp_ns: int, frame: bool = True) -> None:
        """Start with a ``std_msgs/Header`` of this stamp and an empty frame, or with its stamp."""
        self._body = bytearray(stamp_bytes(stamp_ns))
        if frame:
            self.text("")

    def align(self, size: int) -> None:
        """Pad with zeros to a multiple of ``size`` bytes."""
        self._body += bytes(-len(self._body) % size)

    def u8(self, value: int) -> None:
        """One byte."""
        self._body.append(value)

    def u32(self, value: int) -> None:
        """One unsigned 32-bit integer, aligned."""
        self._body += bytes(-len(self._body) & 3)
        self._body += _U32.pack(value)

    def text(self, value: str) -> None:
        """One string."""
        self._body += bytes(-len(self._body) & 3)
        self._body += _text(value) if len(value) > KEPT_TEXT else _kept_text(value)

    def raw(self, data: bytes | memoryview) -> None:
        """Bytes as they are."""
        self._body += data

    def __bytes__(self) -> bytes:
        return ENCAPSULATION + self._body


class CdrReader:
    """Reads one message; a format error is a WireError that names the byte."""

    __slots__ = ("_body", "_position")

    def __init__(self, data: bytes | memoryview) -> None:
        view = memoryview(data)
        if len(view) < len(ENCAPSULATION) or view[:2] != ENCAPSULATION[:2]:
            start = bytes(view[:4]).hex(" ")
            raise WireError(f"not little-endian CDR: the message starts with {start or 'nothing'}")
        self._body = view[len(ENCAPSULATION) :]
        self._position = 0

    def refuse(self, why: str) -> NoReturn:
        """Raise a WireError that names the byte reached."""
        raise WireError(f"malformed message at byte {self._position + 4}: {why}")

    def align(self, size: int) -> None:
        """Skip padding."""
        self._position += -self._position % size

    @property
    def place(self) -> int:
        """Current position in the message."""
        return self._position + len(ENCAPSULATION)

    @property
    def size(self) -> int:
        """Bytes of the message."""
        return len(self._body) + len(ENCAPSULATION)

    def part(self, start: int, end: int) -> bytes:
        """Bytes between two places of the message."""
        return bytes(self._body[start - len(ENCAPSULATION) : end - len(ENCAPSULATION)])

    def take(self, count: int) -> memoryview:
        """Take the next ``count`` bytes, without a copy."""
        start, end = self._position, self._position + count
        if end > len(self._body):
            self.refuse(f"{count} bytes announced, {max(0, len(self._body) - start)} left")
        self._position = end
        return self._body[start:end]

    def u8(self) -> int:
        """One byte."""
        return self.take(1)[0]

    def u32(self) -> int:
        """One unsigned 32-bit integer, aligned."""
        self.align(4)
        return int(_U32.unpack(self.take(4))[0])

    def count(self, least_bytes: int) -> int:
        """Length of a sequence whose elements take at least ``least_bytes`` each."""
        count = self.u32()
        left = len(self._body) - self._position
        if count * least_bytes > left:
            self.refuse(f"{count} elements announced, {left} bytes left")
        return count

    def stamp_ns(self) -> int:
        """Stamp of a ``std_msgs/Header`` in ns; the frame is skipped."""
        seconds, nanoseconds = STAMP.unpack(self.take(8))
        if nanoseconds >= SECOND_NS:
            self.refuse(f"nanoseconds of the stamp = {nanoseconds}, the limit is 999999999")
        self.text()
        return int(seconds) * SECOND_NS + int(nanoseconds)

    def text(self) -> str:
        """One string."""
        start = self._position + (-self._position & 3) + 4
        if start <= len(self._body):  # a sound one, in as few steps as there are
            end = start + _U32.unpack_from(self._body, start - 4)[0]
            raw = self._body[start:end].tobytes()
            if end <= len(self._body) and raw.find(0) == end - start - 1 and raw.isascii():
                self._position = end
                return raw[:-1].decode("ascii")
        return self._any_text()

    def _any_text(self) -> str:
        """The same of any bytes: other letters, or what is wrong with them."""
        length = self.u32()
        if length == 0:
            return ""
        raw = bytes(self.take(length))
        if raw.find(0) != length - 1:
            self.refuse("string without closing zero, or with a zero inside")
        try:
            return raw[:-1].decode()
        except UnicodeDecodeError:
            self.refuse("string is not UTF-8")

    def texts(self) -> tuple[str, ...]:
        """A sequence of strings."""
        self.align(4)
        start = self._position
        for raw, texts in _KEPT:
            if self._body[start : start + len(raw)].tobytes() == raw:
                self._position += len(raw)
                return texts
        texts = tuple(self.text() for _ in range(self.count(4)))
        if self._position - start <= KEPT_BYTES:
            _KEPT.append((bytes(self._body[start : self._position]), texts))
        return texts

    def end(self) -> None:
        """Check that nothing but padding of the middleware follows."""
        left = len(self._body) - self._position
        if left > TRAILING:
            self.refuse(f"{left} surplus bytes after the message")
