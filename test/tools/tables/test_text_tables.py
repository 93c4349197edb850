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

"""Tables of text in the dialects that people export: the same numbers from each."""

from __future__ import annotations

import datetime as dt
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from flea_diag.errors import RecordingError
from flea_diag.tools.tables.cells import moment_s, number
from flea_diag.tools.tables.readers import read_table

ROWS = [(0.01 * k, np.sin(0.1 * k), 1000.0 + k) for k in range(60)]
HEAD = ("time", "current", "speed")
START = dt.datetime(2024, 3, 5, 10, tzinfo=dt.timezone.utc)


def text(
    mark: str = ",", decimal: str = ".", head: tuple[str, ...] = HEAD, form: str = ".6f"
) -> str:
    lines = [mark.join(head)] if head else []
    lines += [mark.join(format(x, form).replace(".", decimal) for x in row) for row in ROWS]
    return "\n".join(lines) + "\n"


PLAIN = text()
SAME: dict[str, tuple[bytes, str]] = {
    "decimal comma": (text(";", ",").encode(), "its numbers have a decimal comma"),
    "decimal comma and tabs": (text("\t", ",").encode(), "parted by tabs"),
    "blanks": (text("  ").encode(), ""),
    "bars": (text("|").encode(), ""),
    "a byte order mark": (PLAIN.encode("utf-8-sig"), ""),
    "UTF-16": (PLAIN.encode("utf-16"), ""),
    "UTF-16 without a mark": (PLAIN.encode("utf-16-le"), ""),
    "lines of an old Mac": (PLAIN.replace("\n", "\r").encode(), ""),
    "a mark at the end of each line": (PLAIN.replace("\n", ",\n").encode(), ""),
    "comments": (("# rig 3\n# operator N\n" + PLAIN).encode(), ""),
    "names in a comment": (("# " + PLAIN).encode(), ""),
    "lines before the names": (("Rig 3\nRate,100\n\n" + PLAIN).encode(), ""),
    "blank lines": (PLAIN.replace("\n", "\n\n").encode(), ""),
    "a line of units": (("time,current,speed\ns,A,rpm\n" + text(head=())).encode(), "holds units"),
    "names and a row in one line": (
        (",".join(HEAD) + "," + text(head=())).encode(), "share a line",
    ),
    "a cell that is no number": (
        PLAIN.replace("0.198669", "#N/A", 1).encode(),
        "1 cell of 'current' without a number: line 4",
    ),
    "a row that is cut off": (
        PLAIN.replace(",1005.000000", "", 1).encode(), "1 of 60 rows are cut off",
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", SAME)
def test_a_dialect_gives_the_numbers_of_the_plain_table(tmp_path: Path, name: str) -> None:
    content, said = SAME[name]
    (tmp_path / "run.csv").write_bytes(content)
    found = read_table(tmp_path / "run.csv")
    assert tuple(found.columns) == HEAD
    assert any(said in note for note in found.notes) if said else not found.notes
    if name == "a row that is cut off":
        return
    read = np.column_stack([found.columns[key] for key in HEAD])
    wanted = np.array(ROWS)
    kept = np.isfinite(read)
    assert (~kept).sum() == (name == "a cell that is no number")
    np.testing.assert_allclose(read[kept], wanted[kept], atol=5e-7)
    if name == "a line of units":
        assert found.units == {"time": "s", "current": "A", "speed": "rpm"}


REFUSED: dict[str, tuple[bytes, str]] = {
    "commas for both": (
        text(",", ",").encode(), "commas separate the columns and are the decimal mark, too",
    ),
    "bytes of no text": (bytes(range(256)), "bytes that no text has"),
}  # fmt: skip


@pytest.mark.parametrize("name", REFUSED)
def test_what_cannot_be_read_is_refused_with_its_cause(tmp_path: Path, name: str) -> None:
    content, words = REFUSED[name]
    (tmp_path / "run.csv").write_bytes(content)
    with pytest.raises(RecordingError, match=words):
        read_table(tmp_path / "run.csv")


def test_a_table_without_names_numbers_its_columns(tmp_path: Path) -> None:
    (tmp_path / "run.csv").write_text(text(head=()), encoding="utf-8")
    assert tuple(read_table(tmp_path / "run.csv").columns) == ("column_1", "column_2", "column_3")


@pytest.mark.parametrize(
    ("cell", "decimal", "value"),
    [
        ("1,234.5", ".", 1234.5), ("1'234'567", ".", 1234567.0), ("-1.234,5", ",", -1234.5),
        ("1 234,5", ",", 1234.5), ("1e-3", ".", 1e-3), ("0,123", ".", None), ("12,34", ".", None),
        ("run", ".", None), ("1,5", ",", 1.5),
    ],
)  # fmt: skip
def test_numbers_as_people_write_them(cell: str, decimal: str, value: float | None) -> None:
    assert number(cell, decimal) == value


WRITTEN: dict[str, Callable[[dt.datetime], str]] = {
    "Z": lambda t: t.strftime("%Y-%m-%dT%H:%M:%S.%fZ"),
    "a zone": lambda t: t.astimezone(dt.timezone(dt.timedelta(hours=5.5))).isoformat(),
    "none": lambda t: t.strftime("%Y-%m-%d %H:%M:%S,%f"),
    "day first": lambda t: t.strftime("%d.%m.%Y %H:%M:%S.%f"),
}


@pytest.mark.parametrize("name", WRITTEN)
def test_moments_are_seconds_since_1970(name: str) -> None:
    moment = START + dt.timedelta(seconds=1.25)
    assert moment_s(WRITTEN[name](moment)) == pytest.approx(moment.timestamp(), abs=1e-6)


def test_times_of_day_are_seconds_of_the_day() -> None:
    assert moment_s("10:00:01.5") == 36001.5
    assert moment_s("1:30 PM") == 48600.0
    assert moment_s("2024-02-31 10:00:00") is None
