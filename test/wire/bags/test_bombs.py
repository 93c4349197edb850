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

"""Bags that are well formed and enormous: refused in one line, in little memory and time."""

from __future__ import annotations

import os
import struct
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest
from support import in_turn
from support.bombs.mcap import (
    TIME_NS,
    chunk,
    end,
    header,
    message,
    record,
    slow_channel,
    text,
)
from support.places import ROOT

from flea_diag.wire.bags.mcap_chunk import CHUNK_LIMIT_BYTES
from flea_diag.wire.command_budget import LIMITS

MOST_MB = 500
PATIENCE_S = 300.0
"""A hang is found by it; how fast they are is for the benches to say."""


def equal_times() -> bytes:
    """Chunks of which each is within the limit, all of one moment: their sum is not."""
    one = chunk(slow_channel() + message(48 << 20))
    return header() + one * 60 + end()


def empty_messages() -> bytes:
    """Two million messages without a byte of data, in some kilobytes."""
    most = CHUNK_LIMIT_BYTES // len(message(0)) - 100
    return header() + chunk(slow_channel() + message(0) * most) + end()


def schemas_inside_chunks() -> bytes:
    """Definitions in chunks, where nobody looked at their size."""
    return header() + b"".join(chunk(slow_channel(pad=15 << 20)) for _ in range(20)) + end()


def one_large_schema() -> bytes:
    return header() + chunk(slow_channel(pad=40 << 20)) + end()


def attachments() -> bytes:
    body = struct.pack("<QQ", 0, 0) + text("a") + text("b")
    large = record(9, body + struct.pack("<Q", 15 << 20) + bytes(15 << 20))
    return header() + slow_channel() + large * 8 + end()


def large_chunk() -> bytes:
    return header() + chunk(slow_channel() + message(CHUNK_LIMIT_BYTES)) + end()


def chunks_in_order() -> bytes:
    """Nothing overlaps, but it goes on for ever."""
    data = slow_channel() + message(48 << 20)
    parts = [chunk(data, TIME_NS + k, TIME_NS + k) for k in range(60)]
    return header() + b"".join(parts) + end()


def no_footer() -> bytes:
    """Channels of a cut file are looked for in its chunks: they are unpacked for that, too."""
    return header() + chunk(slow_channel() + message(48 << 20)) * 60


def lying_times() -> bytes:
    """Each chunk says that it spans all of time."""
    return header() + chunk(slow_channel() + message(48 << 20), 0, 2**62) * 60 + end()


def many_channels() -> bytes:
    """A channel of 15 MB of metadata, again and again, outside any chunk."""
    pad = 15 << 20
    pair = text("k") + struct.pack("<I", pad) + bytes(pad)
    body = struct.pack("<HH", 1, 1) + text("/sensors/slow") + text("cdr")
    return header() + record(4, body + struct.pack("<I", len(pair)) + pair) * 8 + end()


BOMBS: dict[str, Callable[[], bytes]] = {
    make.__name__: make
    for make in (
        equal_times, empty_messages, schemas_inside_chunks, one_large_schema, attachments,
        large_chunk, chunks_in_order, no_footer, lying_times, many_channels,
    )
}  # fmt: skip


PROGRAM = """
import sys
from flea_diag.tools.main import main
for command in (["bag", "check"], ["replay"], ["recover"]):
    print("status", main([*command, sys.argv[1]]), flush=True)
# Of this program alone: ru_maxrss begins with the size of the process that it was forked from.
peak = next(line for line in open("/proc/self/status") if line.startswith("VmHWM"))
print("peak", peak.split()[1])
"""


def readers(bag: Path) -> tuple[list[int], str, float]:
    """Every command that reads a bag, on this one: exit statuses, output, peak memory in MB."""
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    for limit in LIMITS:
        environment.pop(limit.variable, None)
    done = subprocess.run(
        [sys.executable, "-c", PROGRAM, str(bag)],
        env=environment, cwd=ROOT, capture_output=True, text=True, timeout=PATIENCE_S, check=False,
    )  # fmt: skip
    said = done.stdout + done.stderr
    lines = done.stdout.splitlines()
    assert done.returncode == 0, said
    statuses = [int(line.split()[1]) for line in lines if line.startswith("status ")]
    (peak,) = (int(line.split()[1]) / 1000 for line in lines if line.startswith("peak "))
    return statuses, said, peak


@pytest.mark.parametrize("name", in_turn(list(BOMBS), 3))
def test_a_bomb_is_refused_in_one_line_and_little_memory(name: str, tmp_path: Path) -> None:
    bag = tmp_path / "bag"
    bag.mkdir()
    (bag / "bag_0.mcap").write_bytes(BOMBS[name]())
    statuses, said, peak_mb = readers(bag)
    assert 0 not in statuses, said
    assert peak_mb < MOST_MB


@pytest.mark.parametrize("make", [os.mkfifo, os.mkdir], ids=["fifo", "folder"])
def test_what_is_no_regular_file_is_refused_and_not_waited_for(
    make: Callable[[Path], None], tmp_path: Path
) -> None:
    bag = tmp_path / "bag"
    bag.mkdir()
    make(bag / "bag_0.mcap")
    statuses, said, _ = readers(bag)
    assert 0 not in statuses, said


def test_a_device_is_refused(tmp_path: Path) -> None:
    bag = tmp_path / "bag"
    bag.mkdir()
    (bag / "bag_0.mcap").symlink_to("/dev/zero")
    statuses, said, _ = readers(bag)
    assert 0 not in statuses, said
    assert said.count("no regular file") == 3
