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

"""Bags that are well formed and unpack to, hold or keep more than any memory."""

from __future__ import annotations

import os
import sqlite3
import struct
from pathlib import Path
from random import Random

import yaml
import zstandard

from support.bombs.bomb import TOLD, Input, flea, rows, several
from support.bombs.mcap import TIME_NS, chunk, end, header, message, record, slow_channel, text

MEGABYTE = 1 << 20


def _read(folder: Path, chance: Random, content: bytes, *says: str) -> Input:
    bag = folder / "bag"
    bag.mkdir()
    (bag / "bag_0.mcap").write_bytes(content)
    commands = (("replay", bag), ("bag", "check", bag), ("recover", bag, "-o", folder / "out"))
    return Input(flea(*chance.choice(commands)), TOLD, says)


def chunks_of_one_moment(folder: Path, chance: Random) -> Input:
    one = chunk(slow_channel() + message(several(MEGABYTE, 60 * MEGABYTE, chance)))
    return _read(folder, chance, header() + one * several(2, 200, chance) + end())


def chunks_in_order(folder: Path, chance: Random) -> Input:
    size, data = several(MEGABYTE, 60 * MEGABYTE, chance), []
    for k in range(several(2, 100, chance)):
        data.append(chunk(slow_channel() + message(size, TIME_NS + k), TIME_NS + k, TIME_NS + k))
    return _read(folder, chance, header() + b"".join(data) + end())


def chunks_that_span_all_time(folder: Path, chance: Random) -> Input:
    one = chunk(slow_channel() + message(several(1000, 60 * MEGABYTE, chance)), 0, 2**63)
    return _read(folder, chance, header() + one * several(2, 200, chance) + end())


def messages_of_nothing(folder: Path, chance: Random) -> Input:
    one = message(chance.randrange(8))
    packed = chunk(slow_channel() + one * several(1000, 2_000_000, chance))
    return _read(folder, chance, header() + packed * several(1, 5, chance) + end())


def messages_of_nothing_in_order(folder: Path, chance: Random) -> Input:
    """Nothing overlaps and nothing is held back; there are just millions of them."""
    many = several(1000, 400_000, chance)
    parts = []
    for k in range(several(2, 100, chance)):
        now_ns = TIME_NS + k
        parts.append(chunk(slow_channel() + message(0, now_ns) * many, now_ns, now_ns))
    return _read(folder, chance, header() + b"".join(parts) + end())


def messages_outside_of_chunks(folder: Path, chance: Random) -> Input:
    """As large as they look: it is the memory and the time of each that count."""
    many = message(chance.randrange(8), TIME_NS + chance.randrange(2)) * several(
        1000, 1_500_000, chance
    )
    return _read(folder, chance, header() + slow_channel() + many + end())


def records_of_no_kind(folder: Path, chance: Random) -> Input:
    """Millions of records that nobody knows, in chunks or outside."""
    one = record(chance.choice((100, 200, 255)), b"")
    many = one * several(1000, 7_000_000, chance)
    packed = chunk(slow_channel() + many) * several(1, 20, chance)
    return _read(folder, chance, header() + packed + one * several(1, 100_000, chance) + end())


def damaged_chunks(folder: Path, chance: Random) -> Input:
    """Each is a loss of its own."""
    one = record(6, struct.pack("<QQQI", TIME_NS, TIME_NS, 100, 1) + text("") + bytes(8))
    return _read(folder, chance, header() + slow_channel() + one * several(10, 200_000, chance))


def a_hole_that_is_a_chunk(folder: Path, chance: Random) -> Input:
    """A record of many gigabytes that take no room on the disk."""
    size = several(100 * MEGABYTE, 1 << 40, chance)
    head = struct.pack("<BQ", chance.choice((5, 6)), size)
    found = _read(folder, chance, header() + slow_channel() + head)
    os.truncate(folder / "bag" / "bag_0.mcap", size + 10_000)
    return found


def schemas_in_chunks(folder: Path, chance: Random) -> Input:
    one = chunk(slow_channel(pad=several(1000, 60 * MEGABYTE, chance)))
    return _read(folder, chance, header() + one * several(1, 100, chance) + end())


def channels_without_end(folder: Path, chance: Random) -> Input:
    many = several(1000, 65_000, chance)
    body = b"".join(
        record(4, struct.pack("<HH", k, 0) + text(f"/topic{k}") + text("cdr") + bytes(4))
        for k in range(many)
    )
    return _read(folder, chance, header() + chunk(body) * several(1, 5, chance) + end())


def attachments(folder: Path, chance: Random) -> Input:
    size = several(1000, 15 * MEGABYTE, chance)
    body = struct.pack("<QQ", 0, 0) + text("a") + text("b") + struct.pack("<Q", size) + bytes(size)
    packed = chunk(record(9, body)) * several(1, 30, chance)
    return _read(folder, chance, header() + slow_channel() + packed + end())


def cut_within_chunks(folder: Path, chance: Random) -> Input:
    """Without footer: channels are looked for in every chunk."""
    one = chunk(slow_channel() + message(several(MEGABYTE, 60 * MEGABYTE, chance)))
    content = header() + one * several(2, 100, chance)
    return _read(folder, chance, content[: len(content) - chance.randrange(len(one))])


def sizes_that_lie(folder: Path, chance: Random) -> Input:
    """A chunk says that it is small, or large, and is the other."""
    data = slow_channel() + message(several(1000, 60 * MEGABYTE, chance))
    packed = zstandard.ZstdCompressor(level=1).compress(data)
    said = chance.choice((0, 1, len(data) - 1, len(data) + 1, 2**31, 2**63))
    head = struct.pack("<QQQI", TIME_NS, TIME_NS, said, 0) + text("zstd")
    one = record(6, head + struct.pack("<Q", len(packed)) + packed)
    return _read(folder, chance, header() + one * several(1, 50, chance) + end())


def frames_within_frames(folder: Path, chance: Random) -> Input:
    """Zstd of zstd, announced as what it unpacks to in the end."""
    inner = zstandard.ZstdCompressor(level=1).compress(bytes(several(MEGABYTE, 1 << 30, chance)))
    return _read(folder, chance, header() + chunk(slow_channel() + inner) + end())


def _sqlite(folder: Path, chance: Random, rows: list[tuple[object, ...]], mode: str = "") -> Input:
    bag = folder / "bag"
    bag.mkdir()
    with sqlite3.connect(bag / "a.db3") as made:
        made.execute(
            "CREATE TABLE topics(id INTEGER PRIMARY KEY, name, type, serialization_format)"
        )
        made.execute("CREATE TABLE messages(id INTEGER PRIMARY KEY, topic_id, timestamp, data)")
        topic = (1, "/sensors/slow", "sensor_msgs/msg/JointState", "cdr")
        made.execute("INSERT INTO topics VALUES(?, ?, ?, ?)", topic)
        made.executemany("INSERT INTO messages(topic_id, timestamp, data) VALUES(?, ?, ?)", rows)
    made.close()
    information = {
        "version": 9, "storage_identifier": "sqlite3", "relative_file_paths": ["a.db3"],
        "compression_format": "zstd" if mode else "", "compression_mode": mode,
    }  # fmt: skip
    content = yaml.safe_dump({"rosbag2_bagfile_information": information})
    (bag / "metadata.yaml").write_text(content)
    return Input(flea(*chance.choice((("replay", bag), ("bag", "check", bag)))), TOLD)


def packed_rows(folder: Path, chance: Random) -> Input:
    one = zstandard.ZstdCompressor().compress(bytes(several(MEGABYTE, 100 * MEGABYTE, chance)))
    rows = [(1, TIME_NS + k, one) for k in range(several(1, 300, chance))]
    return _sqlite(folder, chance, rows, "MESSAGE")


def rows_of_the_wrong_kind(folder: Path, chance: Random) -> Input:
    odd = (None, -1, 2**63 - 1, 1e300, "x" * 1000, b"", b"\x00\x01\x00\x00")
    rows = [tuple(chance.choice(odd) for _ in range(3)) for _ in range(several(1, 50_000, chance))]
    return _sqlite(folder, chance, rows)


BAGS = rows(
    "bag", chunks_of_one_moment, chunks_in_order, chunks_that_span_all_time, messages_of_nothing,
    messages_of_nothing_in_order, messages_outside_of_chunks, records_of_no_kind, damaged_chunks,
    a_hole_that_is_a_chunk,
    schemas_in_chunks, channels_without_end, attachments, cut_within_chunks, sizes_that_lie,
    frames_within_frames, packed_rows, rows_of_the_wrong_kind,
)  # fmt: skip
