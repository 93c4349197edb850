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

"""Kept results as tables in Markdown; intervals are computed here, from counts."""

from __future__ import annotations

from collections.abc import Sequence

from folded import details, folded, listed, split_rows
from kept import KeptResult, KeptRow

from flea_diag.tools.interval import rate_interval, wilson

ORIGIN = ("date", "commit", "seed", "developed on", "scored on")


def markdown(kept: KeptResult, pictures: Sequence[str] = ()) -> str:
    """Title, origin, notes, pictures and the table of one file; what is wide is folded below."""
    shared, cells = common(columns(kept))
    shown, rest = folded(cells)
    first, others = split_rows(shown)
    below = [*(table(others) if others else ()), *([""] if others else ())]
    below += listed(cells["row"], rest)
    lines = [f"## {kept.title}", "", said_of(kept), "", *((shared, "") if shared else ())]
    lines += [f"{note}\n" for note in kept.notes]
    lines += [*table(first), ""] if len(first) > 1 else []
    lines += [f"![{kept.title}: what the table says]({name})\n" for name in pictures]
    lines += details("the rest of the table" if len(first) > 1 else "in figures", below)
    return "\n".join(lines) + "\n"


def common(cells: dict[str, list[str]]) -> tuple[str, dict[str, list[str]]]:
    """A sentence on what holds for every row, and the columns that differ.

    The count of a share stands in its result.
    """
    same = [n for n in ORIGIN if n in cells and len(set(cells[n])) == 1 and len(cells[n]) > 1]
    words = ", ".join(f"{name} {cells[name][0]}" for name in same)
    left = {name: values for name, values in cells.items() if name not in same}
    if all(" of " in value and value.endswith("%") for value in cells.get("result", ("",))):
        left.pop("n", None)
    return f"All rows: {words}." if words else "", left


def said_of(kept: KeptResult) -> str:
    """How it was measured, and whether that was for this state."""
    made = f"Measured with `{kept.made_by}`."
    if kept.machine:
        made += f" Machine: {kept.machine}."
    if kept.carried_over:
        made += " Carried over from an earlier state; the commit is the one that stated it."
    return made


def columns(kept: KeptResult) -> dict[str, list[str]]:
    """Header -> cells; a column in which nothing stands is left out."""
    rows = kept.rows
    more = dict.fromkeys(name for row in rows for name in row.cells)
    interval = (
        "95 % interval" if all(row.value is None for row in rows) else "95 % interval or range"
    )
    origins = [kept.origin_of(row) for row in rows]
    found = {
        "row": [row.name for row in rows],
        "result": [result(row) for row in rows],
        "n": [count(row) for row in rows],
        interval: [spread(row) for row in rows],
        "compared with": [row.against for row in rows],
        **{name: [row.cells.get(name, "") for row in rows] for name in more},
        **{
            name: [getattr(origin, name.replace(" ", "_")) for origin in origins] for name in ORIGIN
        },
    }
    return {name: cells for name, cells in found.items() if any(cells)}


def result(row: KeptRow) -> str:
    """What was measured, in one cell."""
    if row.right is not None and row.count:
        return f"{row.right} of {row.count}, {100.0 * row.right / row.count:.1f} %"
    if row.events is not None and row.hours:
        return f"{row.events} in {row.hours:g} h"
    if row.value is not None:
        return f"{row.value:g} {row.unit}".strip()
    return row.text


def count(row: KeptRow) -> str:
    """How many runs, or how long, stand behind a result."""
    if row.n:
        return row.n
    if row.count is not None:
        return str(row.count)
    return f"{row.hours:g} h" if row.hours is not None else ""


def spread(row: KeptRow) -> str:
    """Wilson's interval of a share, the exact one of a rate, or the range that was measured."""
    if row.right is not None and row.count:
        low, high = wilson(row.right, row.count)
        return f"{100.0 * low:.1f} to {100.0 * high:.1f} %"
    if row.events is not None and row.hours:
        low, high = rate_interval(row.events, row.hours)
        return f"{low:.2g} to {high:.2g} an hour"
    if row.low is not None and row.high is not None:
        return f"{row.low:g} to {row.high:g}"
    return ""


def table(cells: dict[str, Sequence[str]]) -> list[str]:
    """Lines of a table."""
    lines = [f"| {' | '.join(cells)} |", "|" + "---|" * len(cells)]
    return [
        *lines,
        *(f"| {' | '.join(each)} |" for each in zip(*cells.values(), strict=True)),
    ]
