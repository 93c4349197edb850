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

"""What is kept on disk is found by its content, is made anew when damaged, and is never wrong."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from support.places import ROOT

from flea_diag.configuration import description, disk_cache
from flea_diag.configuration.calibrations import learned
from flea_diag.configuration.disk_cache import kept
from flea_diag.configuration.stand import load_stand
from flea_diag.core.causal_graph.operating_point import QUADRANTS
from flea_diag.core.signatures.signature import signature_table

CONTENT = {"a": [1, 2.5e-300, True, None, "ü"], "b": {"deep": []}}


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("FLEA_CACHE_DIR", str(tmp_path / "cache"))
    return tmp_path / "cache"


def made(*inputs: str, content: Any = CONTENT) -> bool:
    """Whether the content had to be made."""
    calls = []
    found = kept("test", inputs, lambda: calls.append(1) or content)
    assert found == content
    return bool(calls)


def test_content_is_made_once_for_each_input() -> None:
    assert [made("a", "b"), made("a", "b"), made("ab", ""), made("ab"), made("ab")] == [
        True, False, True, True, False,
    ]  # fmt: skip


@pytest.mark.parametrize("damage", [b"", b"garbage", b"0" * 64 + b"{}"])
def test_a_damaged_entry_is_made_anew(folder: Path, damage: bytes) -> None:
    made("a")
    (entry,) = folder.iterdir()
    whole = entry.read_bytes()
    for wrong in (damage, whole[:-1], whole + b" "):
        entry.write_bytes(wrong)
        assert made("a")
        assert entry.read_bytes() == whole


def test_the_entry_of_something_else_is_made_anew(folder: Path) -> None:
    made("a")
    (entry,) = folder.iterdir()
    made("b", content=["b"])
    (other,) = set(folder.iterdir()) - {entry}
    shutil.copy(other, entry)
    assert made("a")


@pytest.mark.parametrize("content", [(1, 2), {1: 2}, float("nan"), {1, 2}])
def test_what_json_would_change_is_not_kept(folder: Path, content: Any) -> None:
    for _ in range(2):
        assert repr(kept("test", ("a",), lambda: content)) == repr(content)
    assert not folder.exists()


def test_nothing_is_kept_where_nothing_can_be_written(folder: Path) -> None:
    folder.write_text("a file")
    assert made("a")
    assert made("a")


def test_entries_depend_on_the_sources(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    assert made("a")
    shutil.copytree(disk_cache.PACKAGE, tmp_path / "package")
    monkeypatch.setattr(disk_cache, "PACKAGE", tmp_path / "package")
    disk_cache._surroundings.cache_clear()
    assert not made("a")
    with (tmp_path / "package" / "core" / "smoothing.py").open("a") as source:
        source.write("\n")
    disk_cache._surroundings.cache_clear()
    assert made("a")
    monkeypatch.undo()
    disk_cache._surroundings.cache_clear()


def test_an_entry_in_use_stays_whatever_is_made_after_it(folder: Path) -> None:
    made("used")
    (entry,) = folder.iterdir()
    os.utime(entry, (0, 0))
    for number in range(disk_cache.MOST_ENTRIES - 1):
        made(str(number))
    assert not made("used")
    made("one more")
    assert not made("used")


def test_only_the_newest_entries_stay_and_what_is_not_ours(folder: Path) -> None:
    folder.mkdir()
    (folder / "thesis.json").write_text("{}")
    os.utime(folder / "thesis.json", (0, 0))
    for number in range(disk_cache.MOST_ENTRIES + 3):
        made(str(number))
    assert (folder / "thesis.json").exists()
    assert len(list(folder.iterdir())) == disk_cache.MOST_ENTRIES + 1


@pytest.fixture
def forgetful() -> Iterator[None]:
    """Nothing is remembered in memory, before and after."""
    description._signatures.cache_clear()
    yield
    description._signatures.cache_clear()


@pytest.mark.usefixtures("forgetful")
def test_signatures_are_the_same_from_disk() -> None:
    stand = load_stand("flea")
    channels = learned(stand).channels
    derived = description.signatures(stand.actuator, stand.faults, channels, 0.01)
    description._signatures.cache_clear()
    faults, tables = description.signatures(stand.actuator, stand.faults, channels, 0.01)
    assert (faults, tables) == derived
    whole = description.described(stand.actuator)
    model = whole.with_sensors([name for name in channels if name in whole.sensors])
    names = tuple(name for name, spec in model.residuals.items() if spec.signs)
    direct = signature_table(model, faults, names, QUADRANTS[1], 0.01)
    assert repr(tables[QUADRANTS[1]]) == repr(direct)


def test_processes_find_what_others_have_kept(folder: Path) -> None:
    program = (
        "from flea_diag.configuration.disk_cache import kept; print(kept('test', ('a',), int))"
    )
    made("a")
    environment = {**os.environ, "FLEA_CACHE_DIR": str(folder)}
    done = subprocess.run(
        [sys.executable, "-c", program], cwd=ROOT, env=environment, capture_output=True, text=True
    )
    assert done.stdout == f"{CONTENT}\n"
