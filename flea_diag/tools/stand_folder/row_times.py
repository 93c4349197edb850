"""The times of a table's rows: which column, in which unit, and where one test ends."""

from __future__ import annotations

import itertools
import math
import re
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from flea_diag.errors import RecordingError
from flea_diag.tools.stand_folder.recorded_series import RecordedSeries, Series

WORDS = ("time", "stamp", "timestamp", "t", "sec", "secs", "seconds", "clock", "elapsed")
SECONDS = {"s": 1.0, "sec": 1.0, "secs": 1.0, "seconds": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9}
SHORT = {1.0: "s", 1e-3: "ms", 1e-6: "us", 1e-9: "ns"}
REGULAR = 0.8
"""Share of the steps of a time that differ from their median by less than a fifth."""
EPOCH_S = 1e8
"""Seconds since 1970 above which a time is one of day (1973)."""
MOST_KEYS = 3


@dataclass(frozen=True)
class RowTimes:
    """When the rows of a table were read.

    Parameters
    ----------
    column
        Name of the column of times; "" where the rows follow at the rate of the scans.
    unit
        Its unit.
    of_day
        Whether it holds times of day; otherwise it begins anywhere.
    period_s
        Median time between two rows.
    starts
        Rows where a recording begins, the first 0.
    split_by
        Columns whose values tell the recordings apart.
    """

    column: str
    unit: str
    of_day: bool
    period_s: float
    starts: tuple[int, ...]
    split_by: tuple[str, ...]


def row_times(recorded: RecordedSeries, rate_hz: float | None) -> RowTimes:
    """Times of a table.

    Raises
    ------
    RecordingError
        No column holds times and no rate is given, or the rows of several recordings cannot be
        told apart.
    """
    column = _time_column(recorded.series)
    if column is None:
        if rate_hz is None:
            has = ", ".join(each.words for each in recorded.series[:20])
            raise RecordingError(
                f"{recorded.path}: no column holds times, it has {has}: give the rate, --rate HZ"
            )
        return RowTimes("", "s", False, 1.0 / rate_hz, (0,), ())
    unit = _unit(column)
    steps = np.diff(column.values)
    starts = (0, *(np.flatnonzero(steps <= 0.0) + 1).tolist())
    period_s = float(np.median(steps[steps > 0.0])) * SECONDS[unit]
    others = [each for each in recorded.series if each is not column]
    keys = _keys(others, starts) if len(starts) > 1 else ()
    if len(starts) > 1 and not keys:
        raise RecordingError(
            f"{recorded.path}: {column.words} begins anew in row {starts[1] + 1} and no columns "
            "tell the recordings apart: write a file for each"
        )
    of_day = float(np.abs(column.values).max()) * SECONDS[unit] > EPOCH_S
    return RowTimes(column.words, unit, of_day, period_s, starts, keys)


def _time_column(series: Sequence[Series]) -> Series | None:
    """The column that rises evenly, one with a name of times first."""
    named = sorted(series, key=lambda each: not _is_named(each))
    return next((each for each in named if _is_time(each)), None)


def _is_named(series: Series) -> bool:
    return any(word in WORDS for word in re.findall(r"[a-z]+", series.words.lower()))


def _is_time(series: Series) -> bool:
    values = series.values
    if len(values) < 3 or not np.isfinite(values).all():
        return False
    steps = np.diff(values)
    median = float(np.median(steps))
    if median <= 0.0 or np.mean(np.abs(steps - median) < 0.2 * median) < REGULAR:
        return False
    # A counter of rows is no time, unless it is called one.
    return _is_named(series) or not float(median).is_integer()


def _unit(series: Series) -> str:
    """Unit of a time: by its name, or by what gives 1 to 1000 readings a second."""
    words = re.findall(r"[a-z]+", series.words.lower())
    said = next((word for word in reversed(words) if word in SECONDS), "")
    if said:
        return SHORT[SECONDS[said]]
    largest = float(np.abs(series.values).max())
    for factor in sorted(SHORT):
        if EPOCH_S < largest * factor < 50.0 * EPOCH_S:
            return SHORT[factor]
    step = float(np.median(np.diff(series.values)))
    return next(u for u, f in (("s", 1.0), ("ms", 1e3), ("us", 1e6), ("ns", math.inf)) if step <= f)


def _keys(series: Sequence[Series], starts: tuple[int, ...]) -> tuple[str, ...]:
    """The fewest columns that are constant in each recording and together differ for each."""
    ends = (*starts[1:], len(series[0].values) if series else 0)
    rows = list(zip(starts, ends, strict=True))
    constant = [
        each
        for each in series
        if each.changes and all(np.ptp(each.values[a:b]) == 0.0 for a, b in rows)
    ]
    for count in range(1, MOST_KEYS + 1):
        for some in itertools.combinations(constant, count):
            if len({tuple(each.values[a] for each in some) for a, _ in rows}) == len(rows):
                return tuple(each.words for each in some)
    return ()
