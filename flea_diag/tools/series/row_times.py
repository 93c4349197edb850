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

"""The times of a table's rows: which column, in which unit, and where one test ends."""

from __future__ import annotations

import itertools
import math
import re
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from flea_diag.errors import RecordingError
from flea_diag.tools.series.recorded_series import RecordedSeries, Series
from flea_diag.tools.tables.row_order import RowOrder, row_order
from flea_diag.wire.sources.mapping import DATENUM, DATENUM_OF_1970

WORDS = frozenset({
    "time", "times", "stamp", "timestamp", "t", "sec", "secs", "seconds", "clock", "elapsed",
    "zeit", "uhrzeit", "zeitstempel", "datenum", "datetime", "date", "datum", "millis", "micros",
    "tick",
    "ticks", "tiempo", "ts",
})  # fmt: skip
SECONDS = {
    "s": 1.0, "sec": 1.0, "secs": 1.0, "seconds": 1.0, "sekunden": 1.0,
    "ms": 1e-3, "msec": 1e-3, "millis": 1e-3, "milliseconds": 1e-3,
    "us": 1e-6, "usec": 1e-6, "micros": 1e-6, "µs": 1e-6, "microseconds": 1e-6,
    "ns": 1e-9, "nsec": 1e-9, "nanoseconds": 1e-9,
    "min": 60.0, "minutes": 60.0, "h": 3600.0, "hours": 3600.0, "d": 86400.0, "days": 86400.0,
    DATENUM: 86400.0,
}  # fmt: skip
"""Word -> seconds."""
SHORT = {
    1.0: "s",
    1e-3: "ms",
    1e-6: "us",
    1e-9: "ns",
    60.0: "min",
    3600.0: "h",
    86400.0: "d",
}
REGULAR = 0.8
"""Share of the steps of a time that differ from their median by less than a fifth."""
RISING = 0.75
"""Share of the steps of a column called a time that must not go back."""
EPOCH_S = 1e8
"""Seconds since 1970 above which a time is one of day (1973)."""
EXCEL_D = (25569.0, 80000.0)
"""Days since 1899-12-30 that a sheet holds for 1970 to 2119."""
SHORTEST_DAY = 1e-4
"""Days between two readings below which a column may be one of days: 9 s."""
DATENUM_D = (DATENUM_OF_1970, DATENUM_OF_1970 + 54_000.0)
"""Days since the year 0 that MATLAB holds for 1970 to 2117."""
EXCEL_START = "1899-12-30T00:00:00Z"
MOST_KEYS = 3
MOST_CONSTANT = 20


@dataclass(frozen=True)
class RowTimes:
    """When the rows of a table were read.

    Parameters
    ----------
    column
        Name of the column of times; "" where the rows follow at the rate of the scans.
    unit
        Its unit.
    start
        Moment that it counts from; "" where it holds times of day.
    order
        Rows in order of time, of each recording in the table.
    split_by
        Columns whose values tell the recordings apart; empty where they are numbered.
    """

    column: str
    unit: str
    start: str
    order: RowOrder
    split_by: tuple[str, ...] = ()

    @property
    def period_s(self) -> float:
        """Median time between two rows."""
        return self.order.period_s


MADE_UP = "2000-01-01T00:00:00Z"
"""Start of times that begin anywhere."""


def row_times(recorded: RecordedSeries, rate_hz: float | None) -> RowTimes:
    """Times of a table.

    Raises
    ------
    RecordingError
        No column holds times and no rate is given.
    """
    column = _time_column(recorded.series)
    if column is None or (rate_hz is not None and not column.changes):
        return _even(recorded, rate_hz)
    unit = "s" if column.is_moment else _unit(column)
    seconds = (column.values - (DATENUM_OF_1970 if unit == DATENUM else 0.0)) * SECONDS[unit]
    values = {each.words: each.values for each in recorded.series if each is not column}
    order = row_order(str(recorded.path), column.words, seconds, values)
    others = [each for each in recorded.series if each is not column]
    keys = _keys(others, order) if len(order.parts) > 1 else ()
    if keys:
        order = replace(order, notes=tuple(n for n in order.notes if "begin anew" not in n))
    return RowTimes(column.words, unit, _start(column, unit), order, keys)


def _even(recorded: RecordedSeries, rate_hz: float | None) -> RowTimes:
    """Rows at a rate that is given."""
    if rate_hz is None:
        has = ", ".join(each.words for each in recorded.series[:20])
        more = f" ({'; '.join(recorded.notes)})" if recorded.notes else ""
        raise RecordingError(
            f"{recorded.path}: no column holds times, it has {has}{more}: give the rate, --rate HZ"
        )
    count = len(recorded.series[0].values)
    order = RowOrder(np.arange(count) / rate_hz, (np.arange(count),))
    return RowTimes("", "s", MADE_UP, order)


def _start(column: Series, unit: str) -> str:
    largest = float(np.nanmax(np.abs(column.values)))
    if unit == "d" and EXCEL_D[0] < largest < EXCEL_D[1]:
        return EXCEL_START
    return "" if largest * SECONDS[unit] > EPOCH_S else MADE_UP


def _time_column(series: Sequence[Series]) -> Series | None:
    """The column of dates, that is called a time, or that rises evenly; in this order."""
    moments = [each for each in series if each.is_moment]
    named = [each for each in series if is_called_time(each)]
    ranked = [
        *moments,
        *(each for each in named if _is_even(each)),
        *(each for each in named if _rises(each)),
        *(each for each in named if not each.changes),
        # A counter of rows is no time, unless it is called one.
        *(each for each in series if _is_even(each) and not _counts(each)),
    ]
    return next(iter(ranked), None)


def is_called_time(series: Series) -> bool:
    """Whether the name of a column says that it holds times."""
    words = re.findall(r"[a-zµ]+", series.words.lower())
    return any(word in WORDS for word in words) and "delta" not in words


def _steps(series: Series) -> np.ndarray[tuple[int], np.dtype[np.float64]]:
    return np.asarray(np.diff(series.values[np.isfinite(series.values)]))


def _is_even(series: Series) -> bool:
    steps = _steps(series)
    if len(steps) < 2 or len(steps) < 0.9 * (len(series.values) - 1):
        return False
    median = float(np.median(steps))
    return median > 0.0 and float(np.mean(np.abs(steps - median) < 0.2 * median)) >= REGULAR


def _rises(series: Series) -> bool:
    """Whether the steps of a column called a time are those of one; rows may be in any order."""
    steps = _steps(series)
    if len(steps) < 2 or len(steps) < 0.9 * (len(series.values) - 1) or not series.changes:
        return False
    if float(np.mean(steps >= 0.0)) >= RISING:
        return True
    ordered = np.diff(np.sort(series.values[np.isfinite(series.values)]))
    median = float(np.median(ordered))
    return median > 0.0 and float(np.mean(np.abs(ordered - median) < 0.2 * median)) >= REGULAR


def _counts(series: Series) -> bool:
    return float(np.median(_steps(series))) == 1.0


def _unit(series: Series) -> str:
    """Unit of a time: by its name, or by what gives 1 to 1000 readings a second."""
    words = re.findall(r"[a-zµ]+", f"{series.words} {series.unit}".lower())
    said = next((word for word in reversed(words) if word in SECONDS), "")
    finite = series.values[np.isfinite(series.values)]
    largest = float(np.abs(finite).max())
    steps = np.diff(np.unique(finite))
    step = float(np.median(steps)) if len(steps) else 1.0
    of_days = SECONDS.get(said, 86400.0) == 86400.0 and step < SHORTEST_DAY
    if of_days and DATENUM_D[0] < largest < DATENUM_D[1]:
        return DATENUM
    if said:
        return SHORT[SECONDS[said]]
    for factor in (1e-9, 1e-6, 1e-3, 1.0):
        if EPOCH_S < largest * factor < 50.0 * EPOCH_S:
            return SHORT[factor]
    if EXCEL_D[0] < largest < EXCEL_D[1] and step < SHORTEST_DAY:
        return "d"
    return next(u for u, f in (("s", 1.0), ("ms", 1e3), ("us", 1e6), ("ns", math.inf)) if step <= f)


def _keys(series: Sequence[Series], order: RowOrder) -> tuple[str, ...]:
    """The fewest columns that are constant in each recording and together differ for each."""
    constant = [
        each
        for each in series
        if each.changes and all(np.ptp(each.values[part]) == 0.0 for part in order.parts)
    ][:MOST_CONSTANT]
    for count in range(1, MOST_KEYS + 1):
        for some in itertools.combinations(constant, count):
            found = {tuple(each.values[part[0]] for each in some) for part in order.parts}
            if len(found) == len(order.parts):
                return tuple(each.words for each in some)
    return ()
