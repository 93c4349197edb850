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

"""What a diagnosis in one process leaves to the one that comes after it."""

from __future__ import annotations

import os
from collections.abc import Callable
from dataclasses import replace
from functools import cache
from pathlib import Path

import pytest
from support.decisions import BAGS

from flea_diag.nodes.stage.verdict_memory import LARGEST_BYTES, NONE, VerdictMemory
from flea_diag.nodes.state_folder import state_folder
from flea_diag.wire.bags.bag import BagReader
from flea_diag.wire.records import AmbiguityGroup, Outcome


class Bus:
    """What the memory wants of a bus: a name, and somebody to tell."""

    name = "stand_2/diagnoser"

    def __init__(self) -> None:
        self.told: list[str] = []
        self.warn = self.told.append


@cache
def verdict() -> AmbiguityGroup:
    """A healthy one, with what was learned of the unit; not a number is not equal to itself."""
    said = BagReader(BAGS / "live_motor_current_bias").records((AmbiguityGroup,))
    found = next(r for _, r in said if isinstance(r, AmbiguityGroup) and r.offsets)
    assert found.outcome is Outcome.NOMINAL
    rates = {"stated_false_alarms_per_hour": 0.1, "supported_false_alarms_per_hour": 0.4}
    return replace(found, **rates)


def test_what_is_kept_is_recalled(tmp_path: Path) -> None:
    kept, bus = verdict(), Bus()
    memory = VerdictMemory(bus, str(tmp_path / "new" / "verdict"))
    assert memory.recall() is None
    memory.keep(replace(kept, outcome=Outcome.DETECTED))
    memory.keep(kept)
    assert VerdictMemory(bus, str(tmp_path / "new" / "verdict")).recall() == kept
    assert [each.name for each in (tmp_path / "new").iterdir()] == ["verdict"]
    assert bus.told == []


def test_each_domain_and_each_stand_has_its_own(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path))
    for domain in ("", "7"):
        monkeypatch.setenv("ROS_DOMAIN_ID", domain)
        VerdictMemory(Bus(), "").keep(verdict())
    kept = sorted(each.name for each in (state_folder() / "verdicts").iterdir())
    assert kept == ["0_stand_2_diagnoser.cdr", "7_stand_2_diagnoser.cdr"]


def test_none_touches_no_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    memory = VerdictMemory(Bus(), NONE)
    memory.keep(verdict())
    assert memory.recall() is None
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("content", [b"", b"not a verdict", bytes(LARGEST_BYTES + 10)])
def test_a_damaged_file_is_said_and_tells_nothing(tmp_path: Path, content: bytes) -> None:
    path, bus = tmp_path / "verdict", Bus()
    path.write_bytes(content)
    assert VerdictMemory(bus, str(path)).recall() is None
    (words,) = bus.told
    assert str(path) in words
    assert "starting without the previous verdict" in words


def test_a_place_that_cannot_be_written_is_said_once(tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    bus = Bus()
    memory = VerdictMemory(bus, str(tmp_path / "file" / "verdict"))
    memory.keep(verdict())
    memory.keep(verdict())
    (words,) = bus.told
    assert "cannot be written" in words


def test_a_damaged_file_is_kept_beside_the_new_one(tmp_path: Path) -> None:
    path, bus = tmp_path / "verdict", Bus()
    path.write_bytes(b"not a verdict")
    memory = VerdictMemory(bus, str(path))
    assert memory.recall() is None
    memory.keep(verdict())
    assert memory.recall() == verdict()
    (kept,) = tmp_path.glob("verdict.damaged-*")
    assert kept.read_bytes() == b"not a verdict"
    (words,) = bus.told
    assert kept.name in words


@pytest.mark.parametrize(
    "make",
    [os.mkfifo, os.mkdir, lambda path: path.symlink_to("/dev/zero")],
    ids=["fifo", "folder", "device"],
)
def test_what_is_no_regular_file_is_neither_read_nor_moved_nor_written(
    tmp_path: Path, make: Callable[[Path], None]
) -> None:
    make(tmp_path / "verdict")
    bus = Bus()
    memory = VerdictMemory(bus, str(tmp_path / "verdict"))
    assert memory.recall() is None
    memory.keep(verdict())
    assert [each.name for each in tmp_path.iterdir()] == ["verdict"]
    assert not (tmp_path / "verdict").is_file()
    (words,) = bus.told
    assert "no regular file" in words
