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

"""Generated code is a file that can be read, and that nobody runs."""

from __future__ import annotations

import hashlib
import traceback
from pathlib import Path

import pytest

from flea_diag.configuration.description import compiled_relations
from flea_diag.configuration.generated_file import source_file

SOURCE = "def double(p, x):\n    return 2.0 * x[0]\n"
DIGEST = hashlib.sha256(SOURCE.encode()).hexdigest()


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("FLEA_CACHE_DIR", str(tmp_path))
    return tmp_path / "generated"


def test_a_file_is_named_by_the_hash_of_its_content(folder: Path) -> None:
    place = Path(source_file(DIGEST, SOURCE))
    assert place == folder / f"{DIGEST}.py"
    assert place.read_text() == SOURCE
    kept = place.stat().st_mtime_ns
    assert source_file(DIGEST, SOURCE) == str(place)
    assert place.stat().st_mtime_ns == kept


@pytest.mark.parametrize("content", [b"", b"raise SystemExit", b"\xff" * 100, SOURCE.encode() * 2])
def test_a_changed_file_is_written_anew(folder: Path, content: bytes) -> None:
    place = Path(source_file(DIGEST, SOURCE))
    place.write_bytes(content)
    source_file(DIGEST, SOURCE)
    assert place.read_text() == SOURCE


def test_what_runs_is_never_read_from_disk_and_a_traceback_shows_its_line(folder: Path) -> None:
    known = compiled_relations("actuator.yaml", ("motor_current", "motor_voltage", "motor_speed"))
    relations = known.functions["relations"]
    place = Path(relations.__code__.co_filename)
    assert place.parent == folder
    assert place.read_text() == known.source
    assert place.stem == hashlib.sha256(known.source.encode()).hexdigest()
    with pytest.raises(AttributeError) as raised:
        relations(None, (0.0,) * len(known.signals))
    last = traceback.extract_tb(raised.value.__traceback__)[-1]
    assert last.line == known.source.splitlines()[last.lineno - 1].strip()


def test_without_a_place_to_write_the_lines_are_kept_in_memory(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "file").write_text("no folder")
    monkeypatch.setenv("FLEA_CACHE_DIR", str(tmp_path / "file"))
    assert source_file(DIGEST, SOURCE) == f"<generated {DIGEST}>"
