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

"""Every numeric constant of core and stages says where it comes from, beside it or below it.

The page of numbers lists those that decide.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest
from support.places import ROOT
from test_machine_numbers import FOLDERS, SCANNER


def constants(source: str) -> Iterator[tuple[str, bool]]:
    """Numeric constants of a module, and whether a comment or a docstring stands with each."""
    return ((constant.name, bool(constant.why)) for constant in SCANNER.constants(source))


def test_every_constant_says_where_it_comes_from() -> None:
    bare = {
        f"{path.relative_to(ROOT)}: {name}"
        for folder in FOLDERS
        for path in sorted(Path(ROOT, folder).rglob("*.py"))
        for name, said in constants(path.read_text(encoding="utf-8"))
        if not said
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


def test_the_page_is_what_the_sources_say() -> None:
    page = SCANNER.PAGE.read_text(encoding="utf-8")
    assert SCANNER.renewed(page) == page, "renew it: python docs/hooks/deciding_numbers.py"


def test_a_number_that_decides_says_more_than_that_it_is_assumed() -> None:
    bare = [row for row in SCANNER.deciding() if len(row[2].why) <= len("assumption")]
    assert not bare, "say why in a docstring below it, or in a comment beside it"


def test_a_number_that_only_counts_decides_nothing() -> None:
    text = "PLAIN = 1\nTOLD = 3.0  # why\nBARE = 4.0\nROW = (0.5, 2.0)\n"
    found = [each for each in SCANNER.constants(text) if each.decides]
    assert [(each.name, repr(each.value), each.why) for each in found] == [
        ("TOLD", "3.0", "why"),
        ("BARE", "4.0", ""),
        ("ROW", "(0.5, 2.0)", ""),
    ]
