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

"""Tables of text in any dialect, read within a budget; what is no number is counted and said."""

from __future__ import annotations

import csv
import gzip
import itertools
import zlib
from collections.abc import Callable, Iterable, Iterator, Sequence
from io import TextIOWrapper
from pathlib import Path
from typing import IO, Any

import numpy as np

from flea_diag.errors import RecordingError, shown
from flea_diag.tools.tables.cells import MISSING, moment_s, number
from flea_diag.tools.tables.dialect import BLANKS, Dialect, dialect_of, encoding_of
from flea_diag.tools.tables.table import MOST_CELLS, ColumnTable, places, unique
from flea_diag.wire.bags.budget import Budget

LONGEST_LINE = 100_000
SAMPLE_BYTES, SAMPLE_LINES = 1 << 16, 200
AT_ONCE = 1000
"""Rows that are charged to the budget, and made numbers, together."""
MOST_BAD = 0.05
"""Share of the cells of a column, or of the rows of a table, that may be damaged."""


def gzipped(
    path: Path, stream: IO[bytes], wanted: Sequence[str] | None, budget: Budget
) -> ColumnTable:
    """A table of text that is packed."""
    try:
        with gzip.GzipFile(fileobj=stream) as plain:
            return text_table(path, plain, wanted, budget)
    except (EOFError, zlib.error, gzip.BadGzipFile) as error:
        raise RecordingError(f"{path}: cannot be unpacked: {error}") from error


def text_table(
    path: Path, stream: Any, wanted: Sequence[str] | None, budget: Budget
) -> ColumnTable:
    """The wanted columns, or all that hold numbers."""
    encoding = encoding_of(path, stream.read(SAMPLE_BYTES))
    stream.seek(0)
    return table_of_lines(path, _lines(path, stream, encoding, budget), wanted)


def table_of_lines(path: Path, lines: Iterator[str], wanted: Sequence[str] | None) -> ColumnTable:
    """Columns of a table by the lines of its text."""
    head = list(itertools.islice(lines, SAMPLE_LINES))
    dialect = dialect_of(path, head)
    known = dialect.header.unique
    for name in wanted or ():
        if name in dialect.header.repeated:
            raise RecordingError(
                f"{path} has {dialect.header.repeated[name]} columns {shown(name)}; by their place "
                f"they are {shown(f'{name}_1')}, {shown(f'{name}_2')}"
            )
    names = unique(known) if wanted is None else tuple(wanted)
    columns = [
        _Column(name, place, dialect)
        for name, place in zip(names, places(path, names, known), strict=True)
    ]
    rows = _Rows(path, dialect, itertools.chain(head[dialect.first_line :], lines), len(known))
    for chunk in rows.chunks():
        for column in columns:
            column.take(path, chunk)
    return _table(path, columns, rows, dialect, wanted is None)


def _table(
    path: Path, columns: Sequence[_Column], rows: _Rows, dialect: Dialect, all_of_them: bool
) -> ColumnTable:
    rows.check()
    if all_of_them:
        texts = tuple(each.name for each in columns if each.is_text)
        columns = [each for each in columns if not each.is_text]
    else:
        texts = ()
        for each in columns:
            each.check(path)
    said = [note for each in columns if (note := each.note())]
    units = dict(zip(dialect.header.unique, dialect.header.units, strict=False))
    return ColumnTable(
        {each.name: np.array(each.values) for each in columns},
        {name: unit for name, unit in units.items() if unit},
        texts,
        frozenset(each.name for each in columns if each.is_moment),
        (*dialect.notes, *rows.notes(), *said),
    )


class _Rows:
    """Rows of a table in chunks, each with the number of its line; damaged ones are counted."""

    def __init__(self, path: Path, dialect: Dialect, lines: Iterable[str], width: int) -> None:
        self._path, self._dialect, self._lines = path, dialect, lines
        self._width = max(1, width - (1 if not dialect.header.names[-1:] or
                                      not dialect.header.names[-1] else 0))  # fmt: skip
        self.count = self.short = 0
        self._first_short = ""

    def chunks(self) -> Iterator[list[tuple[int, Sequence[str]]]]:
        """At most ``AT_ONCE`` rows at a time."""
        chunk: list[tuple[int, Sequence[str]]] = []
        if self._dialect.header.first_row:
            chunk.append((self._dialect.first_line, self._dialect.header.first_row))
        for number_of_line, row in self._rows():
            if not row:
                continue
            self.count += 1
            if len(row) < self._width:
                self._mind(number_of_line, row)
                continue
            chunk.append((number_of_line, row))
            if len(chunk) == AT_ONCE:
                yield chunk
                chunk = []
            if self.count * self._width > MOST_CELLS:
                raise RecordingError(f"{self._path}: more than {MOST_CELLS} cells; cut the file")
        yield chunk

    def _rows(self) -> Iterator[tuple[int, Sequence[str]]]:
        first = self._dialect.first_line + 1
        if self._dialect.separator == BLANKS:
            for k, line in enumerate(self._lines, first):
                yield k, line.split()
            return
        reader = csv.reader(self._lines, delimiter=self._dialect.separator)
        for row in reader:
            yield first + reader.line_num - 1, row

    def _mind(self, number_of_line: int, row: Sequence[str]) -> None:
        self.short += 1
        self._first_short = self._first_short or (
            f"line {number_of_line} has {len(row)} columns instead of {self._width}"
        )

    def check(self) -> None:
        """Refuse a table of which more than ``MOST_BAD`` is damaged."""
        if self.short > MOST_BAD * self.count:
            raise RecordingError(
                f"{self._path}: {self._first_short}, and so do {self.short} of {self.count} rows; "
                "the file is cut off or damaged there"
            )

    def notes(self) -> tuple[str, ...]:
        """What was left out."""
        if not self.short:
            return ()
        return (f"{self.short} of {self.count} rows are cut off and left out: {self._first_short}",)


class _Column:
    """Cells of one column as they are made numbers."""

    def __init__(self, name: str, place: int, dialect: Dialect) -> None:
        self.name, self._place = name, place
        self.values: list[float] = []
        self.is_moment = place in dialect.moments
        decimal = dialect.decimal
        self._read: Callable[[str], float | None] = (
            moment_s if self.is_moment else lambda text: number(text, decimal)
        )
        self._plain = not self.is_moment and decimal == "."
        self._bad = self._filled = 0
        self._first_bad = ("", 0)

    def take(self, path: Path, chunk: Sequence[tuple[int, Sequence[str]]]) -> None:
        """Take the cells of some rows."""
        place = self._place
        if self._plain:
            try:
                self.values += [float(row[place]) for _, row in chunk]
            except ValueError:
                pass
            else:
                self._filled += len(chunk)
                return
        for line, row in chunk:
            self.values.append(self._number(line, row[place]))

    def _number(self, line: int, cell: str) -> float:
        found = self._read(cell)
        if found is not None:
            self._filled += 1
            return found
        if cell.strip().lower() not in MISSING:
            self._filled += 1
            self._mind(line, cell)
        elif cell.strip().startswith("#"):
            self._mind(line, cell)
        return float("nan")

    def _mind(self, line: int, cell: str) -> None:
        self._bad += 1
        self._first_bad = self._first_bad if self._bad > 1 else (cell, line)

    @property
    def is_text(self) -> bool:
        """Whether so many cells are no numbers that it is no column of readings."""
        return self._bad > MOST_BAD * max(1, self._filled)

    def check(self, path: Path) -> None:
        """Refuse a column of text."""
        if self.is_text:
            cell, line = self._first_bad
            raise RecordingError(
                f"{path}: line {line}: {shown(self.name)} = {shown(cell)} is not a number, and so "
                f"are {self._bad} of {len(self.values)} cells of it"
            )

    def note(self) -> str:
        """What was left out; "" for nothing."""
        if not self._bad:
            endless = int(np.isinf(self.values).sum()) if self.values else 0
            return f"{endless} cells of {shown(self.name)} are infinite" if endless else ""
        cell, line = self._first_bad
        count = f"{self._bad} cells" if self._bad > 1 else "1 cell"
        return f"{count} of {shown(self.name)} without a number: line {line} has {shown(cell)}"


def _lines(path: Path, stream: IO[bytes], encoding: str, budget: Budget) -> Iterator[str]:
    """Lines of a text, charged to the budget as they are unpacked."""
    text = TextIOWrapper(stream, encoding=encoding, errors="replace", newline="")
    budget.resume()
    unpacked = 0
    for count, line in enumerate(iter(lambda: text.readline(LONGEST_LINE + 1), ""), 1):
        if len(line) > LONGEST_LINE:
            raise RecordingError(f"{path}: line {count} has more than {LONGEST_LINE} characters")
        unpacked += len(line)
        if count % AT_ONCE == 0:
            budget.unpack(unpacked)
            budget.spend()
            unpacked = 0
        yield line
    budget.unpack(unpacked)
