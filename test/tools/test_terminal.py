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

"""Files that commands leave behind: whole or not at all, and one line where they cannot be."""

from __future__ import annotations

import json
import os
import sys
import threading
import time
from pathlib import Path

import pytest
from support.places import ROOT

from flea_diag.errors import ConfigurationError
from flea_diag.tools.main import main
from flea_diag.tools.terminal import make_folder, progress, write_json, write_text


def test_a_file_is_replaced_and_nothing_is_left_beside_it(tmp_path: Path) -> None:
    target = tmp_path / "result.json"
    write_json(str(target), {"a": 1})
    write_json(str(target), {"a": 2})
    assert json.loads(target.read_text("utf-8")) == {"a": 2}
    assert os.listdir(tmp_path) == ["result.json"]


def test_a_pipe_is_written_to_and_stays_a_pipe(tmp_path: Path) -> None:
    """``--json /dev/null`` and ``--json >(jq .)`` must not put a file in the device's place."""
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    got: list[str] = []
    reader = threading.Thread(target=lambda: got.append(pipe.read_text("utf-8")))
    reader.start()
    write_text(pipe, "words")
    reader.join(30.0)
    assert got == ["words"]
    assert pipe.is_fifo()


@pytest.mark.parametrize("write", [lambda path: write_text(path, "words"), make_folder])
def test_what_cannot_be_written_is_one_line_that_names_it(tmp_path: Path, write) -> None:
    (tmp_path / "file").write_text("", encoding="utf-8")
    target = tmp_path / "file" / "below"
    with pytest.raises(ConfigurationError, match=r"below: cannot be written: Not a directory"):
        write(target)


def test_a_folder_of_results_that_cannot_be_made_ends_with_2(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "file").write_text("", encoding="utf-8")
    bag = str(ROOT / "bags" / "nominal")
    assert main(["replay", "-q", bag, "--json", f"{tmp_path}/file/results/"]) == 2
    assert "file/results: cannot be written" in capsys.readouterr().err


def test_bags_of_one_name_do_not_overwrite_each_other(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    bags = [str(tmp_path / place / "run") for place in "ab"]
    assert main(["replay", *bags, "--json", f"{tmp_path}/results/"]) == 2
    assert "2 bags are named 'run' and would share one file" in capsys.readouterr().err


def test_progress_tells_the_time_left(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(sys.stderr, "isatty", lambda: True)
    for now_s, number in ((100.0, 1), (130.0, 3), (190.0, 10)):
        monkeypatch.setattr(time, "monotonic", lambda now_s=now_s: now_s)
        progress(number, 10, "bag", began_s=100.0)
    told = capsys.readouterr().err.split("\r\x1b[K")
    assert told == ["", "[1/10] bag", "[3/10, 2 min 0 s left] bag", "[10/10, 10 s left] bag\n"]
