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

"""Every source file begins with its copyright line and the licence, as ament_copyright asks for it.

That linter is not on PyPI. It reads all folders but those that begin with a dot or an underscore.
"""

from __future__ import annotations

import os
import re
from collections.abc import Iterator
from pathlib import Path

from support.places import ROOT

SUFFIXES = (".py", ".cmake", ".c", ".cc", ".cpp", ".cxx", ".h", ".hh", ".hpp", ".hxx")
NOT_OURS = ("build", "install", "log", "site", "results")
"""Folders that builds and measurements leave in the source tree."""
COPYRIGHT = re.compile(r"# Copyright 20\d\d flea_diag maintainers")
APPLIES = "Licensed under the Apache License"


def sources(root: Path) -> Iterator[Path]:
    """Files that are read; an empty one needs no line."""
    for folder, names, files in os.walk(root):
        top = Path(folder) == root
        names[:] = [n for n in names if n[0] not in "._" and not (top and n in NOT_OURS)]
        found = (Path(folder, name) for name in files if name.endswith(SUFFIXES))
        yield from (path for path in found if path.stat().st_size)


def licence() -> list[str]:
    """How the licence is to be applied, from its appendix."""
    lines = (ROOT / "LICENSE").read_text(encoding="utf-8").splitlines()
    begin = next(k for k, line in enumerate(lines) if line.strip().startswith(APPLIES))
    return [f"# {line.removeprefix('   ')}".rstrip() for line in lines[begin:]]


def wanting(root: Path) -> list[str]:
    """Files that do not begin so; a line for the shell may come before."""
    rest = ["#", *licence()]
    odd = []
    for path in sources(root):
        lines = path.read_text(encoding="utf-8").split("\n", len(rest) + 3)
        first, *more = lines[2:] if lines[0].startswith("#!") else lines
        if not (COPYRIGHT.fullmatch(first) and more[: len(rest)] == rest):
            odd.append(str(path.relative_to(root)))
    return odd


def test_every_file_says_whose_it_is() -> None:
    assert wanting(ROOT) == [], "begin them as setup.py begins, with the year of their making"


def test_a_file_without_it_is_found(tmp_path: Path) -> None:
    header = "\n".join(["# Copyright 2026 flea_diag maintainers", "#", *licence()])
    files = {"good.py": f"{header}\n\nX = 1\n", "shell.py": f"#!/bin/sh\n\n{header}\n",
             "plain.py": "X = 1\n", "half.py": f"{header[:200]}\n", "empty.py": ""}  # fmt: skip
    for name, text in files.items():
        (tmp_path / name).write_text(text, encoding="utf-8")
    assert sorted(wanting(tmp_path)) == ["half.py", "plain.py"]


def test_contributions_are_under_the_licence_too() -> None:
    """In the words that the linter looks for beside a ``.git``."""
    said = " ".join((ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8").split())
    assert "Any contribution that you make to this repository will be under the Apache 2" in said
    assert "5. Submission of Contributions. Unless You explicitly state otherwise" in said
