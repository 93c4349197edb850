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

"""Rows in the order of their times: repeated, swapped and coarse stamps, and where one ends.

Stamps are true. What is odd about them is counted and said, and the rest of the rows is used.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import numpy.typing as npt

from flea_diag.errors import RecordingError, shown

Array = npt.NDArray[np.float64]
Rows = npt.NDArray[np.intp]

MOST_LOST = 0.05
"""Share of the rows that may have no time."""
COARSE = 0.2
"""Share of rows with the stamp of the row before from which on the clock is a coarse one."""
UNSORTED = 0.2
"""Share of steps back from which on rows are in no order of times."""
BEHIND = 10
"""So many rows in turn that lie behind those before begin a recording; fewer are out of order."""
GAP_STEPS = 10.0
"""Steps from which on a break is a gap."""
JITTER = 0.2
"""Share by which steps may scatter without a word."""


@dataclass(frozen=True, eq=False)
class RowOrder:
    """Rows by time.

    Parameters
    ----------
    seconds
        Time of each row of the table, shape (rows,); NaN where it has none.
    parts
        Rows of each recording of the file, in order of time.
    notes
        What was odd about the times, a line each.
    """

    seconds: Array
    parts: tuple[Rows, ...]
    notes: tuple[str, ...] = ()

    @property
    def period_s(self) -> float:
        """Median time between two rows."""
        steps = [np.diff(self.seconds[part]) for part in self.parts if len(part) > 1]
        return float(np.median(np.concatenate(steps))) if steps else float("nan")


def row_order(where: str, name: str, seconds: Array, columns: Mapping[str, Array]) -> RowOrder:
    """Order of the rows of a table by its column of times.

    Parameters
    ----------
    where, name
        The file, and the column, for messages.
    seconds
        The times, shape (rows,).
    columns
        All columns that are looked at, by which a repeated row is known.

    Raises
    ------
    RecordingError
        Too many rows have no time, or all have the same.
    """
    notes: list[str] = []
    rows: Rows = np.flatnonzero(np.isfinite(seconds))
    lost = len(seconds) - len(rows)
    if lost > MOST_LOST * len(seconds):
        first = int(np.flatnonzero(~np.isfinite(seconds))[0]) + 1
        raise RecordingError(
            f"{where}: {lost} of {len(seconds)} rows have no {name}, the first is row {first}; "
            "every row needs a time"
        )
    if lost:
        notes.append(f"{_rows(lost)} without {name} left out")
    if len(rows) > 1 and np.ptp(seconds[rows]) == 0.0:
        raise RecordingError(
            f"{where}: {shown(name)} is {seconds[rows[0]]:g} in all {len(rows)} rows: the clock "
            "stood still; leave the column out, or give the rate of the rows (--rate HZ)"
        )
    rows = _without_copies(rows, seconds, columns, notes)
    seconds = _spread(rows, seconds, name, notes)
    parts = _parts(rows, seconds, notes)
    return RowOrder(seconds, parts, (*notes, *_of_steps(parts, seconds)))


def _rows(count: int) -> str:
    return f"{count} rows" if count > 1 else "1 row"


def _without_copies(
    rows: Rows, seconds: Array, columns: Mapping[str, Array], notes: list[str]
) -> Rows:
    """Rows without those that repeat the row before in everything."""
    same = np.diff(seconds[rows]) == 0.0
    if not same.any():
        return rows
    at = np.flatnonzero(same)
    for values in columns.values():
        one, two = values[rows[at]], values[rows[at + 1]]
        at = at[(one == two) | (np.isnan(one) & np.isnan(two))]
    if len(at):
        notes.append(f"{_rows(len(at))} written twice, used once")
    return np.delete(rows, at + 1)


def _spread(rows: Rows, seconds: Array, name: str, notes: list[str]) -> Array:
    """Times of a coarse clock, spread evenly over the rows that share a stamp."""
    stamps = seconds[rows]
    if len(rows) < 3 or float(np.mean(np.diff(stamps) == 0.0)) < COARSE:
        return seconds
    starts = np.flatnonzero(np.concatenate([[True], np.diff(stamps) != 0.0]))
    lengths = np.diff([*starts, len(stamps)])
    steps = np.diff(stamps[starts])
    step = float(np.median(steps[steps > 0.0])) if (steps > 0.0).any() else 0.0
    usual = float(np.median(lengths))
    spread = seconds.copy()
    for number, (start, length) in enumerate(zip(starts, lengths, strict=True)):
        share = step / max(usual, float(length))
        late = step - share * length if number == 0 else 0.0
        spread[rows[start : start + length]] += late + share * np.arange(length)
    notes.append(
        f"{name} is coarse: {usual:g} rows share a stamp, they are spread over its {step:g} s"
    )
    return spread


def _parts(rows: Rows, seconds: Array, notes: list[str]) -> tuple[Rows, ...]:
    """Rows of each recording, sorted and without repeated stamps."""
    stamps = seconds[rows]
    back = np.flatnonzero(np.diff(stamps) < 0.0)
    if len(back) > UNSORTED * len(rows):
        notes.append(f"its rows are in no order of time: sorted, {len(back)} steps went back")
        starts = [0]
    else:
        starts = _starts(stamps, back)
        disordered = len(back) - (len(starts) - 1)
        if disordered:
            notes.append(f"{_rows(disordered)} out of order, put in place by time")
    if len(starts) > 1:
        notes.append(f"its times begin anew {len(starts) - 1} times: {len(starts)} recordings")
    found, repeated = [], 0
    for start, end in pairwise([*starts, len(rows)]):
        part = rows[start:end]
        part = part[np.argsort(seconds[part], kind="stable")]
        kept = np.concatenate([[True], np.diff(seconds[part]) > 0.0])
        repeated += int((~kept).sum())
        found.append(part[kept])
    if repeated:
        notes.append(f"{_rows(repeated)} with the time of the row before left out")
    return tuple(found)


def _starts(stamps: Array, back: Rows) -> list[int]:
    """Rows that begin a recording."""
    starts = [0]
    for step in back.tolist():
        top = float(stamps[starts[-1] : step + 1].max()) if step >= starts[-1] else -np.inf
        behind = stamps[step + 1 : step + 1 + BEHIND] <= top
        if len(behind) == BEHIND and bool(behind.all()):
            starts.append(step + 1)
    return starts


def _of_steps(parts: tuple[Rows, ...], seconds: Array) -> list[str]:
    """Gaps and jitter in words."""
    steps = np.concatenate([np.diff(seconds[part]) for part in parts])
    if len(steps) < BEHIND:
        return []
    period_s = float(np.median(steps))
    gaps = steps[(steps > GAP_STEPS * period_s) & (steps > 1.0)]
    said = []
    if len(gaps):
        count = f"{len(gaps)} gaps" if len(gaps) > 1 else "1 gap"
        said.append(f"{count} between rows, the longest of {float(gaps.max()):.4g} s")
    usual = steps[steps <= max(GAP_STEPS * period_s, 1.0)]
    low, high = (float(x) for x in np.quantile(usual, [0.01, 0.99]))
    if high - low > JITTER * period_s:
        said.append(
            f"rows come {1e3 * low:.3g} to {1e3 * high:.3g} ms apart, {1e3 * period_s:.3g} ms in "
            "the middle: taken by their stamps"
        )
    return said
