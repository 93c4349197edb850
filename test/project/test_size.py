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

"""No function is longer than a reader takes in at once, unless the reason stands above it.

The reason is a comment ``# long: <reason>`` on the line above ``def`` or above its decorators.
Complexity (at most 15) is checked by ruff, see C901 in ``pyproject.toml``.
"""

from __future__ import annotations

import ast
from collections.abc import Iterator
from pathlib import Path

import pytest
from support.places import ROOT

FOLDERS = ("flea_diag", "flea_sim_driver", "bench", "bags", "launch")
MOST_LINES = 60
REASON = "# long: "
STILL_LONG: frozenset[str] = frozenset()
"""Functions that still have to be split; none is to be added."""
LONG_BODY = "".join(f"    x{number} = {number}\n" for number in range(MOST_LINES))
LONG = f"def planted():\n{LONG_BODY}"


def too_long(root: Path) -> dict[str, str]:
    """Functions above ``MOST_LINES`` without a reason: name -> place and length."""
    return {
        node.name: f"{path.relative_to(root)}:{node.lineno}, {_length(node)} lines"
        for folder in FOLDERS
        for path in sorted((root / folder).rglob("*.py"))
        for node in _unexcused(path.read_text(encoding="utf-8"))
    }


def _unexcused(source: str) -> Iterator[ast.FunctionDef | ast.AsyncFunctionDef]:
    lines = ["", *source.splitlines()]
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef) and _length(node) > MOST_LINES:
            above = lines[_first_line(node) - 1].strip()
            if not above.removeprefix(REASON).strip() or not above.startswith(REASON):
                yield node


def _first_line(node: ast.FunctionDef | ast.AsyncFunctionDef) -> int:
    return min([node.lineno, *(decorator.lineno for decorator in node.decorator_list)])


def _length(node: ast.FunctionDef | ast.AsyncFunctionDef) -> int:
    return (node.end_lineno or node.lineno) - node.lineno + 1


def test_no_function_is_too_long() -> None:
    found = {name: where for name, where in too_long(ROOT).items() if name not in STILL_LONG}
    assert found == {}


@pytest.mark.parametrize(
    ("source", "found"),
    [
        (LONG, 1),
        (f"class C:\n{''.join(f'    {line}' for line in LONG.splitlines(True))}", 1),
        (f"# long:\n{LONG}", 1),
        (f"# a comment\n{LONG}", 1),
        (f"# long: one table, read top to bottom\n\n{LONG}", 1),
        (f"# long: one table, read top to bottom\n{LONG}", 0),
        (f"# long: one table, read top to bottom\n@cache\n{LONG}", 0),
        (LONG.removesuffix(f"    x{MOST_LINES - 1} = {MOST_LINES - 1}\n"), 0),
    ],
    ids=["plain", "method", "no reason", "other comment", "apart", "reason", "decorated", "60"],
)
def test_a_planted_long_function_is_found(tmp_path: Path, source: str, found: int) -> None:
    path = tmp_path / "flea_diag" / "planted.py"
    path.parent.mkdir()
    path.write_text(source, encoding="utf-8")
    assert len(too_long(tmp_path)) == found


@pytest.mark.parametrize("folder", FOLDERS)
def test_every_folder_is_read(folder: str) -> None:
    assert any((ROOT / folder).rglob("*.py"))
