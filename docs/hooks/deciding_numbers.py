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

``test/project/test_constants.py`` holds the page against this; no constant lacks a reason.
"""

from __future__ import annotations

import ast
from collections.abc import Iterator
from itertools import groupby, takewhile
from pathlib import Path
from typing import Any, NamedTuple

ROOT = Path(__file__).resolve().parents[2]
PAGE = ROOT / "docs" / "numbers.md"
SOURCES = ROOT / "flea_diag"
ROOMS = ("core", "stages")
PLAIN = (0, 1, 2)
"""Numbers that say how many, not how much."""
BEGIN, END = "<!-- numbers -->\n", "<!-- /numbers -->"


Literal = tuple[ast.stmt, ast.stmt | None, list[ast.expr], object]


class Constant(NamedTuple):
    """A number of a module, or numbers in a row; ``why`` is its docstring or comment."""

    name: str
    value: object
    why: str

    @property
    def decides(self) -> bool:
        """Whether it does more than count."""
        every = self.value if isinstance(self.value, tuple | list) else (self.value,)
        return any(abs(each) not in PLAIN for each in _flat(every))


def literals(source: str) -> Iterator[Literal]:
    """Literal constants of a module: their statement and the next one, their targets, the value."""
    body = ast.parse(source).body
    for node, after in zip(body, [*body[1:], None], strict=True):
        if isinstance(node, ast.Assign):
            targets = node.targets
        elif isinstance(node, ast.AnnAssign) and node.value is not None:
            targets = [node.target]
        else:
            continue
        try:
            yield node, after, targets, ast.literal_eval(node.value or node)
        except ValueError:  # made of others, which are counted themselves
            continue


def constants(source: str) -> Iterator[Constant]:
    """Those of a module that are numbers; each of several targets is one of its own."""
    lines = source.splitlines()
    for node, after, targets, value in literals(source):
        if not _is_numeric(value):
            continue
        why = _why(node, after, lines)
        for target in targets:
            for name, own in _named(target, value):
                yield Constant(name, own, why)


def _is_numeric(value: object) -> bool:
    if isinstance(value, tuple | list):
        return bool(value) and all(map(_is_numeric, value))
    return type(value) in (int, float)


def _flat(values: Any) -> Iterator[float]:
    for value in values:
        yield from _flat(value) if isinstance(value, tuple | list) else (value,)


def _named(target: ast.expr, value: Any) -> Iterator[tuple[str, object]]:
    if isinstance(target, ast.Name):
        yield target.id, value
    elif isinstance(target, ast.Tuple):
        for each, own in zip(target.elts, value, strict=True):
            yield from _named(each, own)


def _why(node: ast.stmt, after: ast.stmt | None, lines: list[str]) -> str:
    if isinstance(after, ast.Expr) and isinstance(after.value, ast.Constant):
        return " ".join(str(after.value.value).split())
    _, _, beside = lines[(node.end_lineno or node.lineno) - 1].partition("#")
    if told := beside.removeprefix(" fmt: skip").strip():
        return told
    above = takewhile(lambda line: line.startswith("#"), reversed(lines[: node.lineno - 1]))
    return " ".join(line.lstrip("# ") for line in [*above][::-1])


def deciding() -> Iterator[tuple[str, str, Constant]]:
    """Package, path below it, and constant: all that decide, in order."""
    for room in ROOMS:
        for path in sorted((SOURCES / room).rglob("*.py")):
            place = path.relative_to(SOURCES)
            package = "/".join(place.parts[: min(2, len(place.parts) - 1)])
            for constant in constants(path.read_text(encoding="utf-8")):
                if constant.decides:
                    yield package, place.as_posix(), constant


def table() -> str:
    """The rows as markdown, a heading for each package."""
    parts = []
    for package, rows in groupby(deciding(), key=lambda row: row[0]):
        parts.append(f"## {package}\n\n| number | value | in | why |\n|---|---|---|---|\n")
        for _, path, (name, value, why) in rows:
            told = why.replace("|", r"\|")
            parts.append(f"| `{name}` | {value!r} | `{path}` | {told} |\n")
        parts.append("\n")
    return "".join(parts)


def renewed(text: str) -> str:
    """The page with the table between its markers."""
    before, _, rest = text.partition(BEGIN)
    return f"{before}{BEGIN}{table()}{END}{rest.partition(END)[2]}"


if __name__ == "__main__":
    PAGE.write_text(renewed(PAGE.read_text(encoding="utf-8")), encoding="utf-8")
