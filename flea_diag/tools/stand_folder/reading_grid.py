"""Series of a recording on one grid of times, and which of them could be a channel."""

from __future__ import annotations

import math
from collections import Counter
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from flea_diag.errors import RecordingError
from flea_diag.tools.stand_folder.recorded_joints import RecordedJoints
from flea_diag.tools.stand_folder.recorded_series import (
    FEWEST_READINGS,
    RecordedSeries,
    Series,
)
from flea_diag.tools.stand_folder.row_times import RowTimes, row_times
from flea_diag.tools.stand_folder.series_words import (
    COMMANDED,
    ERROR,
    FORCE,
    POSITION,
    TORQUE,
    NameWords,
    words_of,
)

Array = npt.NDArray[np.float64]

MOST_ROWS = 60_000
FASTEST_HZ, SLOWEST_HZ = 1000.0, 1.0
"""Rates that scans may have."""
ROUND = 0.01
"""Deviation up to which a measured rate is one of a round number."""


@dataclass(frozen=True, eq=False)
class SeriesSum:
    """What a channel could be: one series, or a sum of two.

    Parameters
    ----------
    terms
        Series with their signs.
    words
        What its name says.
    values
        Readings on the grid, shape (n,), as recorded; NaN between two recordings.
    because
        How its quantity is known, where the name does not say it.
    """

    terms: tuple[tuple[Series, int], ...]
    words: NameWords
    values: Array
    because: str = ""

    @property
    def name(self) -> str:
        """Its places, as people name them."""
        signs = ["" if k == 0 and s > 0 else (" + " if s > 0 else " - ") for k, (_, s) in
                 enumerate(self.terms)]  # fmt: skip
        return "".join(f"{s}{each.words}" for s, (each, _) in zip(signs, self.terms, strict=True))

    @property
    def rate_hz(self) -> float:
        """Readings a second, rounded."""
        return rounded_rate(self.terms[0][0].rate_hz)


@dataclass(frozen=True, eq=False)
class ReadingGrid:
    """The series of one recording as columns of rows ``period_s`` apart.

    ``times`` is None for a bag. ``unused`` are series that can be no channel, with the reason.
    """

    recorded: RecordedSeries
    period_s: float
    times: RowTimes | None
    sources: tuple[SeriesSum, ...]
    unused: tuple[tuple[str, str], ...]
    joint: str = ""


def reading_grid(
    recorded: RecordedSeries, rate_hz: float | None = None, joint: str = ""
) -> ReadingGrid:
    """Grid of a recording.

    Parameters
    ----------
    recorded
        Its series.
    rate_hz
        Rate of the rows of a table that has no times.
    joint
        Joint of a JointState to diagnose; "": one that moves.

    Raises
    ------
    RecordingError
        It has no times, or nothing in it changes.
    """
    times = row_times(recorded, rate_hz) if recorded.is_table else None
    joints = RecordedJoints.of(recorded, joint)
    unused = [(name, "no numbers") for name in recorded.silent]
    kept = []
    for series in recorded.series:
        reason = _unused(series, times, joints)
        if reason:
            unused.append((series.words, reason))
        else:
            kept.append(series)
    if not kept:
        raise RecordingError(
            f"{recorded.path}: nothing in it changes: {', '.join(n for n, _ in unused[:10])}; "
            "record a motion"
        )
    period_s = 1.0 / _rate(kept, times)
    sources = tuple(
        SeriesSum(((each, 1),), _worded(each, times), _on_grid(each, times, period_s))
        for each in kept
    )
    sources += tuple(_sums(sources, period_s))
    return ReadingGrid(recorded, period_s, times, sources, tuple(unused), joints.chosen)


def rounded_rate(rate_hz: float) -> float:
    """A rate as people would have set it."""
    if not math.isfinite(rate_hz):
        return rate_hz
    for digits in (1, 2):
        step = 10.0 ** (math.floor(math.log10(rate_hz)) + 1 - digits)
        near = round(rate_hz / step) * step
        if abs(near - rate_hz) <= ROUND * rate_hz:
            return float(f"{near:.6g}")
    return float(f"{rate_hz:.4g}")


def _rate(kept: list[Series], times: RowTimes | None) -> float:
    """Rate of the scans: that of the rows, or the fastest of a topic of the commonest rates."""
    if times is not None:
        found = 1.0 / times.period_s
    else:
        rates = [r for each in kept if (r := rounded_rate(each.rate_hz)) <= FASTEST_HZ]
        if not rates:
            raise RecordingError(
                f"all topics come faster than {FASTEST_HZ:g} Hz; scans have at most that rate"
            )
        counts = Counter(rates)
        found = max(counts, key=lambda rate: (counts[rate], rate))
    if not SLOWEST_HZ * 0.99 <= found <= FASTEST_HZ * 1.01:
        raise RecordingError(
            f"readings come at {found:.4g} Hz; scans have {SLOWEST_HZ:g} to {FASTEST_HZ:g} Hz"
        )
    return rounded_rate(found)


def _unused(series: Series, times: RowTimes | None, joints: RecordedJoints) -> str:
    """Why a series can be no channel; "" if it can."""
    if times is not None and series.words == times.column:
        return "times of the rows"
    if not series.changes:
        return "constant"
    if joints.is_of_another(series):
        return f"of another joint than {joints.chosen}"
    finite = np.isfinite(series.readings)
    if finite.sum() < FEWEST_READINGS or finite.mean() < 0.5:
        return "most of its readings are missing"
    return ""


def _worded(series: Series, times: RowTimes | None) -> NameWords:
    """Words of the name; a load that stands still in each recording was commanded."""
    place = series.place
    name = place.get("column") or f"{place['topic']}/{place['field']}"
    words = words_of(name, place.get("type", ""))
    steady = times is not None and series.words in times.split_by
    if words.quantity in (FORCE, TORQUE) and (steady or _is_stepped(series.readings)):
        words = replace(words, qualifiers=words.qualifiers | {COMMANDED})
    return words


def _is_stepped(values: Array) -> bool:
    """Whether readings are those of a set point that is changed now and then."""
    finite = values[np.isfinite(values)]
    return len(np.unique(finite)) <= 5 and float(np.mean(np.diff(finite) != 0.0)) < 0.01


def _on_grid(series: Series, times: RowTimes | None, period_s: float) -> Array:
    readings = series.readings
    if times is None:
        finite = np.isfinite(readings)
        at, values = series.times_s[finite], readings[finite]
        count = min(MOST_ROWS, int(series.times_s[-1] / period_s) + 1)
        wanted = np.arange(count) * period_s
        return np.asarray(np.interp(wanted, at, values, left=np.nan, right=np.nan))
    # Rows of a table are as good as even; a gap of one row keeps recordings apart.
    values = np.insert(readings, np.array(times.starts[1:], dtype=int), np.nan)
    return np.asarray(values[:MOST_ROWS], dtype=np.float64)


def _sums(sources: tuple[SeriesSum, ...], period_s: float) -> list[SeriesSum]:
    """A position that was recorded as set point and error of its loop."""
    found = []
    for point in sources:
        for error in sources:
            is_point = point.words.quantity == POSITION and COMMANDED in point.words.qualifiers
            is_error = ERROR in error.words.qualifiers
            if is_point and is_error and point.words.unit == error.words.unit:
                # What is commanded leads: an error that grows with the speed is that of the part
                # behind its set point.
                speed = np.gradient(point.values, period_s)
                use = np.isfinite(speed) & np.isfinite(error.values)
                sign = -1 if float(np.corrcoef(speed[use], error.values[use])[0, 1]) > 0 else 1
                words = replace(point.words, qualifiers=point.words.qualifiers - {COMMANDED})
                terms = (*point.terms, (error.terms[0][0], sign))
                found.append(SeriesSum(terms, words, point.values + sign * error.values))
    return found
