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

"""The names of a table's columns: one line, two lines, a line of units, or a line with readings."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass

from flea_diag.core.symbolic.converted_unit import CONVERTED
from flea_diag.core.symbolic.unit import UNITS
from flea_diag.tools.tables.cells import moment_s, number

_UNIT_LIKE = re.compile(r"[\[(<]?\s*[^\W\d]?[\w°µ%Ωμ·*/^.²³-]{0,7}\s*[\])>]?")
_SAID = frozenset(
    x.lower()
    for x in (*CONVERTED, *UNITS, "s", "sec", "degC", "°C", "°", "C", "Nm", "-", "1", "%", "bar",
              "deg", "rad", "1/min", "r/min", "m/s", "grad", "h", "W")
)  # fmt: skip


@dataclass(frozen=True)
class Header:
    """Names of the columns, their units where a line says them, and readings beside them."""

    names: tuple[str, ...]
    units: tuple[str, ...] = ()
    first_row: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()

    @property
    def repeated(self) -> dict[str, int]:
        """Names of several columns, and of how many."""
        return {n: self.names.count(n) for n in self.names if n and self.names.count(n) > 1}

    @property
    def unique(self) -> tuple[str, ...]:
        """Names that tell the columns apart: those that are repeated are numbered."""
        seen: dict[str, int] = {}
        found = []
        for name in self.names:
            seen[name] = seen.get(name, 0) + 1
            found.append(f"{name}_{seen[name]}" if name in self.repeated else name)
        return tuple(found)


def header_of_rows(before: Sequence[Sequence[str]], width: int, numeric: int) -> Header:
    """Header by the lines before the first row of readings.

    Parameters
    ----------
    before
        Cells of each such line that is no comment.
    width
        Columns of the rows.
    numeric
        How many of them hold numbers; without any, the first line is the header.
    """
    if not numeric:
        return Header(_clean(before[0] if before else ()))
    if not before:
        names = tuple(f"column_{k + 1}" for k in range(width))
        return Header(names, notes=(f"it has no header: its columns are called {names[0]} to "
                                    f"{names[-1]}",))  # fmt: skip
    last = before[-1]
    if _distinct(last, width) < width - 1 and not _are_groups(before, width):
        last = max(before, key=lambda cells: _distinct(cells, width))
        before = before[: before.index(last) + 1]
    glued = _glued(last, width)
    if glued is not None:
        return glued
    if len(before) > 1 and _are_units(last) and len(before[-2]) >= width:
        units = tuple(each.strip().strip("[]()<>").strip() for each in last)
        return Header(_clean(before[-2]), units, notes=("its second line holds units",))
    if len(before) > 1 and len(before[-2]) == len(last) >= width:
        return Header(_joined(before[-2], last), notes=("its names are of two lines",))
    if len(last) == width - 1 and all(cell.strip() for cell in last):
        return Header(("row", *_clean(last)), notes=("its first column has no name",))
    return Header(_clean(last))


def _are_groups(before: Sequence[Sequence[str]], width: int) -> bool:
    """Whether the last two lines together name each column, the first of them in groups."""
    if len(before) < 2 or not len(before[-2]) == len(before[-1]) >= width:
        return False
    return _distinct(_joined(before[-2], before[-1]), width) >= width - 1


def _distinct(cells: Sequence[str], width: int) -> int:
    """How many different names a line has for so many columns."""
    names = {cell.strip() for cell in cells if cell.strip() and not _is_reading(cell)}
    return len(names) if len(cells) >= width else 0


def _clean(cells: Sequence[str]) -> tuple[str, ...]:
    return tuple(cell.strip().lstrip("\ufeff").lstrip("#").strip() for cell in cells)


def _glued(cells: Sequence[str], width: int) -> Header | None:
    """A header that the first row of readings follows in the same line."""
    if len(cells) != 2 * width:
        return None
    names, row = cells[:width], tuple(cells[width:])
    if any(_is_reading(c) for c in names) or not all(_is_reading(c) for c in row):
        return None
    return Header(_clean(names), first_row=row, notes=("its header and first row share a line",))


def _is_reading(cell: str) -> bool:
    return number(cell) is not None or moment_s(cell) is not None


def _are_units(cells: Sequence[str]) -> bool:
    """Whether a line holds units rather than names."""
    filled = [cell.strip() for cell in cells if cell.strip()]
    if not filled or not all(_UNIT_LIKE.fullmatch(cell) for cell in filled):
        return False
    known = [cell.strip("[]()<> ").lower() in _SAID or cell[0] in "[(<" for cell in filled]
    return sum(known) > 0.5 * len(filled)


def _joined(above: Sequence[str], last: Sequence[str]) -> tuple[str, ...]:
    """Names of two lines, the first of which names groups of columns."""
    names, group = [], ""
    for one, two in zip(_clean(above), _clean(last), strict=True):
        group = one or group
        names.append(" ".join(each for each in (group, two) if each))
    return tuple(names)
