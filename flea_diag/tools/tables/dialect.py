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

"""The dialect of a table of text: encoding, separator, decimal mark, and where its rows begin."""

from __future__ import annotations

import codecs
import csv
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from flea_diag.errors import RecordingError, shown
from flea_diag.tools.tables.cells import MISSING, moment_s, number
from flea_diag.tools.tables.header import Header, header_of_rows

BLANKS = " "
"""Separator that stands for any number of blanks."""
SEPARATORS = (",", ";", "\t", "|", BLANKS)
COMMENTS = ("#", "%", "//")
FEW = 5
"""Rows that say how many cells all have."""
LOOKED_AT = 60
"""Rows at the end of the sample by which a dialect is judged."""
_MARKS = ((codecs.BOM_UTF8, "utf-8-sig"), (codecs.BOM_UTF32_LE, "utf-32"),
          (codecs.BOM_UTF32_BE, "utf-32"), (codecs.BOM_UTF16_LE, "utf-16"),
          (codecs.BOM_UTF16_BE, "utf-16"))  # fmt: skip
_NAMES = {"\t": "tabs", BLANKS: "blanks", ",": "commas", ";": "semicolons", "|": "bars"}


@dataclass(frozen=True)
class Dialect:
    """How a table of text is written.

    Parameters
    ----------
    separator, decimal
        Mark between cells and in numbers; ``BLANKS`` for any number of blanks.
    header
        Names and units of the columns.
    first_line
        Number of the first line of readings, from 0.
    moments
        Places of columns with dates or times of day.
    notes
        What is unusual about it, a line each.
    """

    separator: str
    decimal: str
    header: Header
    first_line: int
    moments: frozenset[int]
    notes: tuple[str, ...]


def encoding_of(path: Path, sample: bytes) -> str:
    """Encoding of a text by its first bytes.

    Raises
    ------
    RecordingError
        It is no text.
    """
    for mark, name in _MARKS:
        if sample.startswith(mark):
            return name
    zeros = [sample[k::2].count(0) / max(1, len(sample[k::2])) for k in (0, 1)]
    if max(zeros) > 0.4 and min(zeros) < 0.1:
        return "utf-16-le" if zeros[1] > zeros[0] else "utf-16-be"
    if b"\0" in sample:
        raise RecordingError(f"{path} holds bytes that no text has: it is no table of text")
    try:
        codecs.getincrementaldecoder("utf-8")("strict").decode(sample)
    except UnicodeDecodeError:
        return "cp1252"
    return "utf-8"


def cells_of(line: str, separator: str) -> list[str]:
    """Cells of one line."""
    if separator == BLANKS:
        return line.split()
    return next(csv.reader([line], delimiter=separator), [])


def is_reading(cell: str, decimal: str) -> bool:
    """Whether a cell is a number, a date, or a time of day."""
    return number(cell, decimal) is not None or moment_s(cell) is not None


def dialect_of(path: Path, lines: Sequence[str]) -> Dialect:
    """Dialect of a table by its first lines.

    Raises
    ------
    RecordingError
        Commas are both separator and decimal mark.
    """
    body = [k for k, line in enumerate(lines) if line.strip() and not _is_comment(line)]
    separator, decimal = _marks([lines[k] for k in body])
    rows = {k: cells_of(lines[k].rstrip("\r\n"), separator) for k in body}
    last = [rows[k] for k in body[-LOOKED_AT:]]
    width = _width([r for r in last if any(is_reading(c, decimal) for c in r)] or last)
    tail = [row for row in last if len(row) >= width]
    numeric = {p for p in range(width) if _share(tail, p, decimal) >= 0.5}
    first = next((k for k in body if _is_row(rows[k], numeric, width, decimal)), None)
    if first is None:
        first = len(lines)
    before = [rows[k] for k in body if k < first]
    remark = next((x for x in reversed(lines[:first]) if x.strip()), "")
    if _is_comment(remark) and not (before and len(before[-1]) == width):
        named = cells_of(remark.lstrip("#%/ ").rstrip("\r\n"), separator)
        before += [named] if len(named) == width else []
    header = header_of_rows(before, width, len(numeric))
    if len(tail) > FEW and len(header.names) > width and not header.first_row:
        # Names without cells, such as a comment behind the last column.
        header = replace(header, names=header.names[:width], units=header.units[:width])
    if separator == "," and width > len(header.names) + 1 > 2:
        raise RecordingError(
            f"{path}: line {first + 1} has {width} cells and its header {len(header.names)} names, "
            f"{shown(', '.join(header.names[:4]))[1:-1]}: commas separate the columns and are the "
            "decimal mark, too; write it with semicolons, or with points"
        )
    moments = frozenset(p for p in numeric if _are_moments(tail, p, decimal))
    return Dialect(separator, decimal, header, first, moments, _notes(separator, decimal, header))


def _notes(separator: str, decimal: str, header: Header) -> tuple[str, ...]:
    said = []
    if decimal == ",":
        said.append(f"its numbers have a decimal comma, its columns are parted by "
                    f"{_NAMES[separator]}")  # fmt: skip
    return (*said, *header.notes)


def _is_comment(line: str) -> bool:
    return line.lstrip("\ufeff \t").startswith(COMMENTS)


def _marks(lines: Sequence[str]) -> tuple[str, str]:
    """Separator and decimal mark by which most cells of most lines are readings."""
    tail = lines[-LOOKED_AT:]
    best, found = 0.0, (max(",;\t", key="".join(lines[:1]).count), ".")
    for separator in SEPARATORS:
        rows = [cells_of(line.rstrip("\r\n"), separator) for line in tail]
        width = _width(rows)
        alike = [row for row in rows if len(row) >= width]
        if width < 2 or not alike:
            continue
        for decimal in ".,":
            if decimal == "," and (separator == "," or not any("," in c for r in alike for c in r)):
                continue
            cells = [cell for row in alike for cell in row[:width] if _is_filled(cell)]
            share = sum(is_reading(cell, decimal) for cell in cells) / max(1, len(cells))
            score = share * len(alike) / len(rows) * (1.0 + 1e-3 * (decimal == ","))
            # Blanks part a date from its time of day, and a name from its unit.
            score *= 0.97 if separator == BLANKS else 1.0
            if score > best:
                best, found = score, (separator, decimal)
    return found


def _is_filled(cell: str) -> bool:
    return cell.strip().lower() not in MISSING


def _width(rows: Sequence[Sequence[str]]) -> int:
    """Cells of most rows; a mark at the end of each of them begins no cell."""
    counts = Counter(len(row) - (len(row) > 1 and not row[-1].strip()) for row in rows if row)
    return max(counts, key=lambda width: (counts[width], width)) if counts else 0


def _share(rows: Sequence[Sequence[str]], place: int, decimal: str) -> float:
    """Share of readings among the filled cells of a column; 1 where none is filled."""
    cells = [row[place] for row in rows if _is_filled(row[place])]
    return sum(is_reading(cell, decimal) for cell in cells) / len(cells) if cells else 1.0


def _is_row(row: Sequence[str], numeric: set[int], width: int, decimal: str) -> bool:
    """Whether a line holds readings in the columns of numbers."""
    if len(row) < width or not numeric:
        return False
    cells = [row[p] for p in numeric if _is_filled(row[p])]
    if not cells:
        return False
    return sum(is_reading(cell, decimal) for cell in cells) > 0.5 * len(cells)


def _are_moments(rows: Sequence[Sequence[str]], place: int, decimal: str) -> bool:
    cells = [row[place] for row in rows if _is_filled(row[place])]
    return bool(cells) and sum(number(c, decimal) is None for c in cells) > 0.5 * len(cells)
