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

"""Sheets of Excel (XLSX), by openpyxl."""

from __future__ import annotations

import zipfile
from collections.abc import Iterator, Sequence
from dataclasses import replace
from datetime import datetime, time
from pathlib import Path
from typing import IO, Any

from flea_diag.errors import RecordingError, shown
from flea_diag.tools.extra import require
from flea_diag.tools.tables.table import ColumnTable
from flea_diag.tools.tables.text_table import table_of_lines
from flea_diag.wire.bags.budget import Budget


def excel(
    path: Path, stream: IO[bytes], wanted: Sequence[str] | None, budget: Budget
) -> ColumnTable:
    """Columns of the first sheet that has two rows."""
    require("excel", str(path))
    from openpyxl import load_workbook

    try:
        with zipfile.ZipFile(stream) as archive:
            budget.unpack(sum(info.file_size for info in archive.infolist()))
        stream.seek(0)
        book = load_workbook(stream, read_only=True, data_only=True)
        sheets = [sheet for sheet in book.worksheets if _has_rows(sheet)]
        if not sheets:
            raise RecordingError(f"{path}: none of its sheets holds rows")
        found = table_of_lines(path, _lines(sheets[0], budget), wanted)
    except RecordingError:
        raise
    except Exception as error:  # whatever openpyxl makes of damaged bytes
        raise RecordingError(f"{path}: not an XLSX file: {shown(str(error))}") from error
    if len(sheets) == 1:
        return found
    others = ", ".join(shown(sheet.title) for sheet in sheets[1:])
    note = f"read is its sheet {shown(sheets[0].title)}, not {others}"
    return replace(found, notes=(*found.notes, note))


def _has_rows(sheet: Any) -> bool:
    rows = sheet.iter_rows(max_row=200, values_only=True)
    return sum(any(cell is not None for cell in row) for row in rows) > 1


def _lines(sheet: Any, budget: Budget) -> Iterator[str]:
    """Rows as lines of text, so that headers and units are found as in any other table."""
    budget.resume()
    for count, row in enumerate(sheet.iter_rows(values_only=True)):
        if count % 1000 == 0:
            budget.spend()
        yield "\t".join(_text(cell) for cell in row) + "\n"


def _text(cell: Any) -> str:
    if cell is None:
        return ""
    if isinstance(cell, datetime | time):
        return cell.isoformat()
    text = repr(cell) if isinstance(cell, float | int) else str(cell)
    return '"' + text.replace('"', '""') + '"' if any(c in text for c in '\t\r\n"') else text
