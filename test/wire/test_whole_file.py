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

"""A file is there as it was or as it is to be, and what is no file stays what it is."""

from __future__ import annotations

import os
import resource
import stat
import threading
from pathlib import Path

import pytest

from flea_diag.wire.whole_file import replace_file, replacing_folder


@pytest.mark.parametrize("durable", [False, True])
def test_a_file_is_replaced_and_nothing_is_left_beside_it(tmp_path: Path, durable: bool) -> None:
    path = tmp_path / "file"
    for content in (b"old", b"new"):
        replace_file(path, content, durable=durable)
        assert path.read_bytes() == content
    assert list(tmp_path.iterdir()) == [path]


def test_what_cannot_be_written_leaves_the_old_one(tmp_path: Path) -> None:
    path = tmp_path / "file"
    path.mkdir()
    (path / "full").touch()
    with pytest.raises(OSError, match="Is a directory"):
        replace_file(path, b"new")
    assert list(tmp_path.iterdir()) == [path]
    assert list(path.iterdir()) == [path / "full"]


def test_the_mode_is_kept_and_a_link_is_not_followed(tmp_path: Path) -> None:
    path, elsewhere = tmp_path / "file", tmp_path / "elsewhere"
    elsewhere.write_bytes(b"mine")
    path.touch(0o640)
    replace_file(path, b"new")
    assert stat.S_IMODE(path.stat().st_mode) == 0o640
    path.unlink()
    path.symlink_to(elsewhere)
    replace_file(path, b"newer")
    assert (path.is_symlink(), path.read_bytes()) == (False, b"newer")
    assert elsewhere.read_bytes() == b"mine"


def test_several_writers_do_not_mix_what_they_write(tmp_path: Path) -> None:
    path = tmp_path / "file"
    contents = [bytes([letter]) * 300_000 for letter in b"abcd"]
    writers = [
        threading.Thread(target=lambda c=c: [replace_file(path, c) for _ in range(20)])
        for c in contents
    ]
    for writer in writers:
        writer.start()
    for writer in writers:
        writer.join(60.0)
    assert path.read_bytes() in contents
    assert list(tmp_path.iterdir()) == [path]


def _half(folder: Path) -> None:
    """Fail in the middle of making a folder."""
    for _ in range(2):
        folder.mkdir()
        (folder / "two").touch()


def test_a_folder_is_replaced_whole_or_not_at_all(tmp_path: Path) -> None:
    path = tmp_path / "bag"
    with replacing_folder(path) as fresh:
        fresh.mkdir()
        (fresh / "one").touch()
    with pytest.raises(FileNotFoundError), replacing_folder(path):
        pass  # nothing has been made that could replace it
    with pytest.raises(FileExistsError), replacing_folder(path) as fresh:
        _half(fresh)
    assert [entry.name for entry in path.iterdir()] == ["one"]
    with replacing_folder(path) as fresh:
        fresh.mkdir()
    assert list(path.iterdir()) == []
    assert list(tmp_path.iterdir()) == [path]


def test_half_a_file_does_not_stay_beside_the_old_one(tmp_path: Path) -> None:
    path = tmp_path / "file"
    path.write_bytes(b"old")
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (1000, limits[1]))
    try:
        with pytest.raises(OSError, match="too large"):
            replace_file(path, bytes(100_000))
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)
    assert path.read_bytes() == b"old"
    assert list(tmp_path.iterdir()) == [path]


def test_a_pipe_is_written_to_and_stays_one(tmp_path: Path) -> None:
    pipe, read = tmp_path / "pipe", []
    os.mkfifo(pipe)
    reader = threading.Thread(target=lambda: read.append(pipe.read_bytes()))
    reader.start()
    replace_file(pipe, b"told")
    reader.join(30.0)
    assert read == [b"told"]
    assert pipe.is_fifo()
