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

"""Records of an MCAP file, byte by byte, so that any of them can lie."""

from __future__ import annotations

import struct

import zstandard

from flea_diag.wire.bags.mcap_file import MAGIC

TIME_NS = 10**18


def record(opcode: int, body: bytes) -> bytes:
    return struct.pack("<BQ", opcode, len(body)) + body


def text(value: str) -> bytes:
    return struct.pack("<I", len(value)) + value.encode()


def header() -> bytes:
    return MAGIC + record(1, text("ros2") + text("bomb"))


def slow_channel(number: int = 1, pad: int = 0) -> bytes:
    """Schema and channel of a topic of ours."""
    schema = record(3, struct.pack("<H", 1) + text("sensor_msgs/msg/JointState") + text("ros2msg")
                    + struct.pack("<I", pad) + bytes(pad))  # fmt: skip
    body = struct.pack("<HH", number, 1) + text("/sensors/slow") + text("cdr")
    return schema + record(4, body + struct.pack("<I", 0))


def message(size: int, log_ns: int = TIME_NS) -> bytes:
    return record(5, struct.pack("<HIQQ", 1, 0, log_ns, log_ns) + bytes(size))


def chunk(data: bytes, start_ns: int = TIME_NS, end_ns: int = TIME_NS) -> bytes:
    packed = zstandard.ZstdCompressor(level=1).compress(data)
    head = struct.pack("<QQQI", start_ns, end_ns, len(data), 0) + text("zstd")
    return record(6, head + struct.pack("<Q", len(packed)) + packed)


def end() -> bytes:
    return record(15, bytes(4)) + record(2, struct.pack("<QQI", 0, 0, 0)) + MAGIC
