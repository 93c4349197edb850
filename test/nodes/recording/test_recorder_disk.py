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

"""A recorder on a disk that really runs full, in a file that may not grow, in a read-only place."""

from __future__ import annotations

import fcntl
import signal
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from support.live import ROOT, Peer, Process, node
from support.recordings import START_NS, TABLE, opened, publish, recorder, scan, until_written

from flea_diag.wire.records import ChannelTable, Health, Scan, VibrationBlock

MEGABYTES = 6
SPEAKS_FIRST = ("-p", "stop_free_mb:=0", "-p", "warn_free_mb:=0")
"""Switches the watch on free space off: what the disk itself says is looked for."""


def blocks() -> Iterator[VibrationBlock]:
    """More than the disk holds; noise, for nothing here is to be compressed."""
    random = np.random.default_rng(1)
    offsets = np.arange(4000, dtype=np.uint32) * 25_000
    for number in range(80):
        samples = random.normal(size=(4000, 6))
        yield VibrationBlock.pack(START_NS + number * 10**8, tuple("abcdef"), offsets, samples)


def filled(command: list[str], domain: int) -> tuple[int, str]:
    """Record more than there is room for; exit status and words."""
    with Process(command, domain) as process, Peer(domain) as peer:
        peer.listen(Health)
        assert peer.bus.wait_for_subscribers(ChannelTable, VibrationBlock, timeout_s=60.0)
        peer.bus.publish(TABLE)
        for block in blocks():
            peer.bus.publish(block)
            # A second's worth each second is not needed, only that no message is overrun.
            peer.bus.wait_until(lambda: process.child.poll() is not None, 0.03)
        peer.until(lambda: process.child.poll() is not None)
        return process.end(), process.output


@pytest.fixture
def small_disk(tmp_path: Path) -> Iterator[Path]:
    """A file system of its own, where this user may make one."""
    place = tmp_path / "disk"
    place.mkdir()
    mount = ["mount", "-t", "tmpfs", "-o", f"size={MEGABYTES}m", "tmpfs", str(place)]
    if subprocess.run(mount, capture_output=True, check=False).returncode:
        pytest.skip("may not mount a small disk; the limit of a file's size is tested instead")
    yield place
    subprocess.run(["umount", str(place)], check=True)


def test_a_disk_that_runs_full_is_said_and_the_bag_is_whole(domain: int, small_disk: Path) -> None:
    status, words = filled(recorder(small_disk / "run", *SPEAKS_FIRST), domain)
    assert status == 2
    assert f"cannot write bag {small_disk / 'run'}: No space left on device" in words
    assert "Traceback" not in words
    assert opened(small_disk / "run")["/sensors/vibration"] > 5


def test_a_file_that_may_not_grow_is_said_and_the_bag_is_whole(domain: int, tmp_path: Path) -> None:
    command = recorder(tmp_path / "run", *SPEAKS_FIRST)
    limited = ["prlimit", f"--fsize={MEGABYTES << 20}", *command]
    status, words = filled(limited, domain)
    assert status == 2
    assert f"cannot write bag {tmp_path / 'run'}: File too large" in words
    assert "Traceback" not in words
    assert opened(tmp_path / "run")["/sensors/vibration"] > 5


def test_a_read_only_place_is_refused_in_one_line(domain: int) -> None:
    with Process(recorder(Path("/sys/run"), *SPEAKS_FIRST), domain) as process:
        assert process.end() == 2
    assert "flea_diag: cannot write bag /sys/run: " in process.output
    assert "Traceback" not in process.output


@pytest.mark.in_turn(2)
def test_a_disk_that_does_not_answer_for_seconds_costs_no_message(
    domain: int, tmp_path: Path
) -> None:
    """Four seconds of scans come meanwhile, four times what a stage keeps of them."""
    gate, bag = tmp_path / "gate", tmp_path / "run"
    arguments = node("x", "-p", f"directory:={bag}")[4:]
    command = [
        sys.executable,
        str(ROOT / "test" / "support" / "programs" / "stalling_recorder.py"),
        str(gate),
        *arguments,
    ]
    gate.touch()
    with Process(command, domain) as process, Peer(domain) as peer, gate.open() as held:
        peer.listen(Health)
        publish(peer, 20)
        until_written(peer, 21)
        fcntl.flock(held, fcntl.LOCK_EX)
        peer.until(gate.with_suffix(".stalls").exists)
        for number in range(20, 420):
            peer.bus.publish(scan(number))
            if number % 50 == 0:
                assert peer.acknowledged(Scan)
        fcntl.flock(held, fcntl.LOCK_UN)
        until_written(peer, 421)
        assert process.signal(signal.SIGTERM) == 0
    assert opened(bag)["/sensors/slow"] == 420
