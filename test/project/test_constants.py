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

"""Every numeric constant of core and stages says where it comes from, beside it or below it."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from pathlib import Path

import pytest
from support.places import ROOT
from test_machine_numbers import FOLDERS, literals

ELSEWHERE = {
    "SECOND_NS": "by definition",
    "PERIOD_S": "bounds of a file",
    "SHIFT_WINDOWS_S": "docstring of the module",
    "PIECE_SCANS": "size of a sample",
    "ENTER_S": "docstring of the module",
    "CLEAN_S": "docstring of the module",
    "SATURATED_S": "docstring of the function",
}
"""Constants that say it elsewhere."""


def is_numeric(value: object) -> bool:
    if isinstance(value, tuple | list):
        return bool(value) and all(map(is_numeric, value))
    return type(value) in (int, float)


def constants(source: str) -> Iterator[tuple[str, bool]]:
    """Numeric constants of a module, and whether a comment or a docstring stands with each."""
    lines = source.splitlines()
    for node, after, targets, value in literals(source):
        below = isinstance(after, ast.Expr) and isinstance(after.value, ast.Constant)
        above = node.lineno > 1 and lines[node.lineno - 2].startswith("#")
        beside = "#" in lines[(node.end_lineno or 1) - 1]
        if is_numeric(value):
            for name in (n for each in targets for n in ast.walk(each)):
                if isinstance(name, ast.Name):
                    yield name.id, below or above or beside


def test_every_constant_says_where_it_comes_from() -> None:
    bare = {
        f"{path.relative_to(ROOT)}: {name}"
        for folder in FOLDERS
        for path in sorted(Path(ROOT, folder).rglob("*.py"))
        for name, said in constants(path.read_text(encoding="utf-8"))
        if not said and name not in ELSEWHERE
    }
    assert not bare, "say in a comment or docstring where the number comes from"


@pytest.mark.parametrize(
    ("source", "expected"),
    [
        ("A = 1.5", [("A", False)]),
        ("A = 1.5  # by definition", [("A", True)]),
        ('A: float = -1.0\n"""Assumption."""', [("A", True)]),
        ("# Assumption.\nA, B = 1, 2", [("A", True), ("B", True)]),
        ("X = 3\nA = ((1.0, 2.0), (2.0, 3.0))", [("X", False), ("A", False)]),
        ("A = 2 * B\nNAMES = ('a',)\nC = True", []),
    ],
)
def test_a_planted_constant_is_found(source: str, expected: list[tuple[str, bool]]) -> None:
    assert list(constants(source)) == expected
