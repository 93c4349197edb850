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

"""A wide table as one that fits a page and a phone, and what is left out of it folded below."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

MOST_COLUMNS = 6
LONGEST_CELL = 30
"""Characters of a cell that stands in the open; longer ones would break into many lines."""
MOST_ROWS = 30
ALWAYS = ("row", "result", "95 % interval", "95 % interval or range")

Cells = Mapping[str, Sequence[str]]


def folded(cells: Cells) -> tuple[dict[str, Sequence[str]], dict[str, Sequence[str]]]:
    """Columns that stand in the open, and those that do not."""
    fits = [n for n in cells if n in ALWAYS or max(map(len, (n, *cells[n]))) <= LONGEST_CELL]
    room = MOST_COLUMNS - sum(name in ALWAYS for name in fits)
    more = [name for name in fits if name not in ALWAYS][: max(room, 0)]
    shown = {name: values for name, values in cells.items() if name in (*ALWAYS, *more)}
    return shown, {name: values for name, values in cells.items() if name not in shown}


def listed(rows: Sequence[str], rest: Cells) -> Iterator[str]:
    """What the open table leaves out, once for all rows of which it holds."""
    alike: dict[tuple[tuple[str, str], ...], list[str]] = {}
    for place, row in enumerate(rows):
        told = tuple((name, values[place]) for name, values in rest.items() if values[place])
        if told:
            alike.setdefault(told, []).append(row)
    for told, names in alike.items():
        said = "; ".join(f"{name} {value}" for name, value in told)
        whose = "all rows" if len(names) == len(rows) else ", ".join(names)
        yield f"- **{whose}**: {said}"


def details(summary: str, lines: Sequence[str]) -> list[str]:
    """Lines behind a heading that opens them, on the site and where the repository is browsed."""
    if not lines:
        return []
    return ['<details markdown="1">', f"<summary>{summary}</summary>", "", *lines, "", "</details>"]


def split_rows(cells: Cells) -> tuple[dict[str, Sequence[str]], dict[str, Sequence[str]]]:
    """The first rows of a long table, and the others."""
    first = {name: values[:MOST_ROWS] for name, values in cells.items()}
    others = {name: values[MOST_ROWS:] for name, values in cells.items()}
    return first, others if len(cells["row"]) > MOST_ROWS else {}
