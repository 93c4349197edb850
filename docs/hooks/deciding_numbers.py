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

"""The table of docs/numbers.md: the numbers of core and stages that decide, each with its reason.

    python docs/hooks/deciding_numbers.py        renew it

``test/project/test_deciding_numbers.py`` holds the page against this; no number lacks a reason.
"""

from __future__ import annotations

import ast
from collections.abc import Iterator
from itertools import groupby
from pathlib import Path
from typing import NamedTuple

ROOT = Path(__file__).resolve().parents[2]
PAGE = ROOT / "docs" / "numbers.md"
SOURCES = ROOT / "flea_diag"
ROOMS = ("core", "stages")
PLAIN = (0, 1, 2)
"""Numbers that say how many, not how much."""
BEGIN, END = "<!-- numbers -->\n", "<!-- /numbers -->"


class Number(NamedTuple):
    """A constant of a module; ``why`` is its docstring or comment."""

    package: str
    module: str
    name: str
    value: str
    why: str


def numbers() -> Iterator[Number]:
    """All of them, by package and module."""
    for room in ROOMS:
        for path in sorted((SOURCES / room).rglob("*.py")):
            place = path.relative_to(SOURCES)
            package = "/".join(place.parts[:2]) if len(place.parts) > 2 else place.parts[0]
            module = place.relative_to(package).as_posix()
            yield from of_source(package, module, path.read_text(encoding="utf-8"))


def of_source(package: str, module: str, text: str) -> Iterator[Number]:
    """Those of one module."""
    lines, body = text.splitlines(), ast.parse(text).body
    for node, follows in zip(body, [*body[1:], None], strict=True):
        target = node.targets[0] if isinstance(node, ast.Assign) else getattr(node, "target", None)
        value = getattr(node, "value", None)
        if isinstance(target, ast.Name) and value is not None and _decides(value):
            told = ast.unparse(value)
            yield Number(package, module, target.id, told, _why(node, follows, lines))


def _decides(value: ast.expr) -> bool:
    """Whether an expression is a number, or numbers in a row, other than those that only count."""
    try:
        found = ast.literal_eval(value)
    except ValueError:
        return False
    every = found if isinstance(found, tuple) else (found,)
    numeric = bool(every) and all(type(each) in (int, float) for each in every)
    return numeric and any(abs(each) not in PLAIN for each in every)


def _why(node: ast.stmt, follows: ast.stmt | None, lines: list[str]) -> str:
    if isinstance(follows, ast.Expr) and isinstance(follows.value, ast.Constant):
        return " ".join(str(follows.value.value).split())
    last = (node.end_lineno or node.lineno) - 1
    _, found, beside = lines[last].partition("  # ")
    if found:
        return beside.strip()
    above = node.lineno - 2
    told: list[str] = []
    while above >= 0 and lines[above].startswith("# "):
        told.insert(0, lines[above][2:])
        above -= 1
    return " ".join(told)


def table() -> str:
    """The rows as markdown, a heading for each package."""
    parts = []
    for package, rows in groupby(numbers(), key=lambda row: row.package):
        parts.append(f"## {package}\n\n| number | value | in | why |\n|---|---|---|---|\n")
        for row in rows:
            why = row.why.replace("|", r"\|")
            parts.append(f"| `{row.name}` | {row.value} | `{row.package}/{row.module}` | {why} |\n")
        parts.append("\n")
    return "".join(parts)


def renewed(text: str) -> str:
    """The page with the table between its markers."""
    before, _, rest = text.partition(BEGIN)
    return f"{before}{BEGIN}{table()}{END}{rest.partition(END)[2]}"


if __name__ == "__main__":
    PAGE.write_text(renewed(PAGE.read_text(encoding="utf-8")), encoding="utf-8")
