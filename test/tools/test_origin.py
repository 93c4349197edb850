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

"""The commit that a figure is measured on: of the repository, of the build, or the version."""

from __future__ import annotations

import subprocess
from pathlib import Path

import pytest

from flea_diag import __version__
from flea_diag.tools.origin import NOTE, commit

NAMED = ("-c", "user.name=a", "-c", "user.email=a@example.invalid", "-c", "commit.gpgsign=false")


def git(folder: Path, *arguments: str) -> str:
    command = ["git", "-C", str(folder), *NAMED, *arguments]
    try:
        return subprocess.run(command, capture_output=True, text=True, check=True).stdout.strip()
    except FileNotFoundError:
        pytest.skip("needs git")


def note(folder: Path, text: str) -> Path:
    path = folder / NOTE
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text, encoding="utf-8")
    return path


def test_the_commit_of_a_repository_and_a_plus_where_files_differ(tmp_path: Path) -> None:
    git(tmp_path, "init", "--quiet")
    file = tmp_path / "a"
    file.write_text("1", encoding="utf-8")
    git(tmp_path, "add", "a")
    git(tmp_path, "commit", "--quiet", "-m", "first")
    head = git(tmp_path, "rev-parse", "HEAD")[:9]
    assert commit(tmp_path) == head
    commit.cache_clear()
    file.write_text("2", encoding="utf-8")
    assert commit(tmp_path) == head + "+"


def test_an_installed_package_knows_what_it_was_built_from(tmp_path: Path) -> None:
    git(tmp_path, "init", "--quiet")  # around the environment, and none of its business
    built, bare = tmp_path / "built", tmp_path / "bare"
    note(built, "123456789\n")
    bare.mkdir()
    assert commit(built) == "123456789"
    assert commit(bare) == f"version {__version__}"
