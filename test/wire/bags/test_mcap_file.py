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

"""A file that is broken off anywhere while it grows is a sound MCAP up to its last end."""

from __future__ import annotations

import os
import shutil
from pathlib import Path
from unittest.mock import patch

import pytest
from mcap.reader import make_reader
from mcap.writer import Writer
from rosbags.rosbag2.storage_mcap import McapReader

from flea_diag.wire.bags import mcap_file
from flea_diag.wire.bags.mcap_file import McapFile

PIECE = 64
"""Bytes after which a write is broken off; an end is shorter, and lies in one page."""


def numbers(path: Path) -> list[int]:
    """Messages of a file, as the format's own library and another one read them."""
    with path.open("rb") as stream:
        found = [message.log_time for _, _, message in make_reader(stream).iter_messages()]
    scanned = McapReader(path)
    scanned.open()
    assert scanned.metadata.message_count == len(found)
    scanned.close()
    return found


def grown(path: Path) -> None:
    """Two messages with an end, then two more, then the Writer's own end."""
    file = McapFile(path)
    writer = Writer(file, chunk_size=1 << 20)
    writer.start(profile="ros2")
    channel = writer.register_channel("t", "cdr", writer.register_schema("s", "ros2msg", b""))
    for number in range(4):
        writer.add_message(channel, number, os.urandom(60), number, number)
        if number % 2:
            writer.flush()
            file.end_for_now()
    writer.finish()
    file.finish()
    file.close()


def test_whatever_was_written_last_the_file_reads(tmp_path: Path) -> None:
    states: list[Path] = []
    really = os.pwrite

    def in_pieces(descriptor: int, data: bytes, at: int) -> int:
        count = really(descriptor, data[:PIECE], at)
        states.append(tmp_path / f"state_{len(states)}.mcap")
        shutil.copy(tmp_path / "whole.mcap", states[-1])
        return count

    with patch.object(mcap_file.os, "pwrite", in_pieces):
        grown(tmp_path / "whole.mcap")
    assert numbers(tmp_path / "whole.mcap") == [0, 1, 2, 3]
    # Before its first end a file is not one yet; and the last state has the Writer's end and ours.
    begun = next(k for k, state in enumerate(states) if _reads(state) == [0, 1])
    read = [_reads(state) for state in states[begun:-1]]
    assert read == sorted(read)
    assert {tuple(each) for each in read} == {(0, 1), (0, 1, 2, 3)}
    assert len(read) > 10


def _reads(path: Path) -> list[int]:
    try:
        return numbers(path)
    except Exception:  # the library says so in many ways
        return []


def test_a_disk_that_is_full_leaves_what_was_there(tmp_path: Path) -> None:
    path = tmp_path / "file.mcap"
    file = McapFile(path)
    writer = Writer(file, chunk_size=1 << 20)
    writer.start(profile="ros2")
    channel = writer.register_channel("t", "cdr", writer.register_schema("s", "ros2msg", b""))
    writer.add_message(channel, 0, b"first", 0, 0)
    writer.flush()
    file.end_for_now()
    writer.add_message(channel, 1, bytes(100_000), 1, 1)
    writer.flush()
    full = patch.object(mcap_file.os, "pwrite", side_effect=OSError(28, "No space left on device"))
    with full, pytest.raises(OSError, match="No space"):
        file.end_for_now()
    assert numbers(path) == [0]
    file.end_for_now()
    assert numbers(path) == [0, 1]
    file.close()
