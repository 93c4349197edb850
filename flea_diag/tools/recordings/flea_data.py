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

"""Text format of the FLEA: low-speed ``.data`` files as published by NASA Ames (2010).

Tab separated, no header, one line per 10 ms: a time stamp with its UTC offset
(``2010-09-03_11:09:58.01000_-0700``) and nineteen numbers, ``NaN`` for values not recorded.
X and Y are the two test actuators, Z is the load actuator. An invalid line is dropped and
reported; a file with more than 5 % of invalid lines is refused.
"""

from __future__ import annotations

import re
from array import array
from collections.abc import Iterator
from dataclasses import dataclass
from datetime import datetime
from functools import lru_cache
from pathlib import Path

import numpy as np
import numpy.typing as npt

from flea_diag.errors import RecordingError, shown
from flea_diag.wire.records import SECOND_NS
from flea_diag.wire.regular_file import opened

COLUMNS = (
    "Desired Position",
    "Actuator X Position",
    "Actuator Y Position",
    "Actuator Z Position",
    "Desired Load",
    "Measured Load",
    "Motor X Current",
    "Motor Y Current",
    "Motor Z Current",
    "Motor X Voltage",
    "Motor Y Voltage",
    "Motor Z Voltage",
    "Motor X Temperature",
    "Motor Y Temperature",
    "Motor Z Temperature",
    "Nut X Temperature",
    "Nut Y Temperature",
    "Nut Z Temperature",
    "Ambient Temperature",
)
"""Columns after the time stamp."""

LIMITS: dict[str, tuple[float, float, str]] = {
    "Position": (-50.0, 150.0, "mm"),
    "Load": (-1000.0, 1000.0, "lb"),
    "Current": (-60.0, 60.0, "A"),
    "Voltage": (-60.0, 60.0, "V"),
    "Temperature": (-100.0, 300.0, "degC"),
}
"""Last word of a column -> limits of its sensor, far beyond observed spikes."""

_BOUNDS = tuple(LIMITS[column.rpartition(" ")[2]][:2] for column in COLUMNS)

FILE_LIMIT_BYTES = 32 << 20
LINE_LIMIT_BYTES = 1024
BAD_LINES_LIMIT = 0.05

_STAMP = re.compile(r"(\d{4}-\d\d-\d\d_\d\d:\d\d):(\d\d)\.(\d{1,9})_([+-]\d{4})")
_YEARS = tuple(str(year) for year in range(1980, 2100))


@dataclass(frozen=True)
class FleaData:
    """One file: stamps in ns as recorded, including repeated and backward stamps.

    ``values`` has shape (lines, 19), in the units of the file; ``dropped`` describes the invalid
    lines.
    """

    path: Path
    stamps_ns: npt.NDArray[np.int64]
    values: npt.NDArray[np.float64]
    dropped: tuple[str, ...]

    def column(self, name: str) -> npt.NDArray[np.float64]:
        """Values of one column."""
        return self.values[:, COLUMNS.index(name)]


class _LineError(ValueError):
    """Reason why a line is invalid."""


def read_flea_data(path: Path) -> FleaData:
    """Read one file.

    Raises
    ------
    RecordingError
        The file is too large, cannot be opened, or has another format; names the first invalid
        line.
    """
    stamps, values = array("q"), array("d")
    dropped: list[str] = []
    for number, line, last in _lines(path):
        try:
            stamp_ns, row = _read_line(line, last)
        except _LineError as error:
            dropped.append(f"{path.name}: line {number}: {error}")
        else:
            stamps.append(stamp_ns)
            values.extend(row)
    total = len(stamps) + len(dropped)
    if len(dropped) > max(1, BAD_LINES_LIMIT * total) or not stamps:
        refused = dropped[0] if dropped else f"{path.name}: the file is empty"
        raise RecordingError(
            f"{refused} ({len(dropped)} of {total} lines are invalid, above the limit of "
            f"{BAD_LINES_LIMIT:.0%}: not a FLEA .data file)"
        )
    table = np.frombuffer(values, dtype=np.float64).reshape(len(stamps), len(COLUMNS))
    return FleaData(path, np.frombuffer(stamps, dtype=np.int64), table, tuple(dropped))


def _lines(path: Path) -> Iterator[tuple[int, bytes, bool]]:
    """Line numbers, lines, and whether the file ends within the line."""
    try:
        with opened(path, FILE_LIMIT_BYTES) as stream:
            number = 0
            while line := stream.readline(LINE_LIMIT_BYTES + 1):
                number += 1
                yield number, line.rstrip(b"\r\n"), not line.endswith(b"\n")
    except OSError as error:
        raise RecordingError(f"cannot read {path}: {error.strerror or error}") from error


def _read_line(line: bytes, cut: bool) -> tuple[int, list[float]]:
    if len(line) > LINE_LIMIT_BYTES:
        raise _LineError(f"longer than the limit of {LINE_LIMIT_BYTES} bytes")
    stamp, *texts = line.decode("ascii", "backslashreplace").split("\t")
    if len(texts) != len(COLUMNS):
        why = "the file ends within it: " if cut else ""
        raise _LineError(f"{why}{len(texts) + 1} columns, must be {len(COLUMNS) + 1}")
    if cut and texts[-1] != "NaN" and _decimals(texts[-1]) < max(map(_decimals, texts)):
        # A truncated number still parses; it is recognised by its missing digits.
        raise _LineError(f"the file ends within it: column {len(texts) + 1} = {shown(texts[-1])}")
    return _stamp_ns(stamp), _row(texts)


def _decimals(text: str) -> int:
    return len(text.partition(".")[2])


def _row(texts: list[str]) -> list[float]:
    """Values of a line; only where one is wrong are they read one by one, to name it."""
    try:
        row = list(map(float, texts))
        if not any(
            value < low or value > high for value, (low, high) in zip(row, _BOUNDS, strict=True)
        ):
            return row
    except ValueError:
        pass
    return [_value(number, text) for number, text in enumerate(texts)]


def _value(number: int, text: str) -> float:
    column = COLUMNS[number]
    where = f"column {number + 2} ({column}) = {shown(text)}"
    try:
        value = float(text)
    except ValueError:
        raise _LineError(f"{where} is not a number") from None
    low, high, unit = LIMITS[column.rpartition(" ")[2]]
    # NaN (not recorded) passes, since all comparisons with it are false.
    if value < low or value > high:
        raise _LineError(f"{where} is outside its limits of {low:g} to {high:g} {unit}")
    return value


def _stamp_ns(text: str) -> int:
    match = _STAMP.fullmatch(text)
    if match is None:
        raise _LineError(
            f"column 1 (Time) = {shown(text)} must be like 2010-09-03_11:09:58.01_-0700"
        )
    minute, seconds, fraction, offset = match.groups()
    if int(seconds) >= 60 or minute[:4] not in _YEARS:
        raise _LineError(
            f"column 1 (Time) = {shown(text)} is outside its limits of the years {_YEARS[0]} to "
            f"{_YEARS[-1]} and 60 seconds"
        )
    return _minute_ns(minute, offset) + int(seconds) * SECOND_NS + int(fraction.ljust(9, "0"))


@lru_cache(maxsize=16)
def _minute_ns(minute: str, offset: str) -> int:
    try:
        moment = datetime.strptime(f"{minute}{offset}", "%Y-%m-%d_%H:%M%z")
    except ValueError:
        raise _LineError(f"column 1 (Time) = {shown(minute)} is not a date and time") from None
    return int(moment.timestamp()) * SECOND_NS
