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

"""Series of a recording on one grid of times, and which of them could be a channel."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from flea_diag.configuration.channels import FASTEST_HZ, SLOWEST_HZ
from flea_diag.errors import RecordingError
from flea_diag.tools.recordings.wrapped_angle import turn_of, unwrapped
from flea_diag.tools.series.no_readings import no_reading, quaternions
from flea_diag.tools.series.one_way_voltage import NO_MOTOR_VOLTAGE, one_way_voltages
from flea_diag.tools.series.recorded_bag import FEWEST_READINGS
from flea_diag.tools.series.recorded_joints import RecordedJoints
from flea_diag.tools.series.recorded_series import RecordedSeries, Series
from flea_diag.tools.series.row_times import RowTimes, row_times
from flea_diag.tools.series.series_sum import SeriesSum, rounded_rate
from flea_diag.tools.series.series_words import (
    COMMANDED,
    CURRENT,
    EFFORT,
    ERROR,
    FORCE,
    POSITION,
    SPEED,
    TORQUE,
    VOLTAGE,
    NameWords,
    words_of,
)
from flea_diag.tools.series.time_base import TimeBase, of_bag, of_table, on_grid

Array = npt.NDArray[np.float64]

MOST_ROWS = 60_000


@dataclass(frozen=True, eq=False)
class ReadingGrid:
    """The series of one recording as columns of rows ``period_s`` apart.

    ``times`` is None for a bag. ``unused`` are series that can be no channel, with the reason.
    ``joints`` are groups of series that move, of which ``joint`` is looked at. ``notes`` say what
    was done to the recording, a line each.
    """

    recorded: RecordedSeries
    period_s: float
    times: RowTimes | None
    sources: tuple[SeriesSum, ...]
    unused: tuple[tuple[str, str], ...]
    joint: str = ""
    joints: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()


def reading_grid(
    recorded: RecordedSeries,
    rate_hz: float | None = None,
    joint: str = "",
    group: str = "",
    supplies: bool = False,
) -> ReadingGrid:
    """Grid of a recording.

    Parameters
    ----------
    recorded
        Its series.
    rate_hz
        Rate of the rows of a table that has no times, and of the scans.
    joint, group
        Joint and namespace, axis or drive to diagnose; "": one that moves.
    supplies
        Whether a voltage that does not belong to the motor may be that of a supply.

    Raises
    ------
    RecordingError
        It has no times, or nothing in it changes.
    """
    times = row_times(recorded, rate_hz) if recorded.is_table else None
    joints = RecordedJoints.of(recorded, joint, group)
    unused = [(name, "no numbers") for name in recorded.silent]
    kept, same = [], _Twins()
    told = {id(each): _worded(each, times) for each in recorded.series}
    told |= {id(s): OF_BATTERY for s in recorded.series if supplies and _is_battery(s)}
    turns = _of_quaternions(recorded, told)
    for series in recorded.series:
        reason = _unused(series, told[id(series)], times, joints)
        reason = reason or (
            "of a quaternion" if id(series) in turns else same.twin_of(series, told[id(series)])
        )
        if reason:
            unused.append((series.words, reason))
        else:
            kept.append(series)
    if not kept:
        reasons = ", ".join(f"{n} ({why})" for n, why in unused[:10])
        raise RecordingError(
            f"{recorded.path}: nothing in it changes that a sensor reads: {reasons}; record a "
            "motion"
        )
    words = [told[id(each)] for each in kept]
    base = of_bag(kept) if times is None else of_table(kept, times)
    period_s = 1.0 / (rate_hz or _rate(base, words, times))
    sources = tuple(_sources(base, words, period_s))
    one_way = () if supplies else one_way_voltages(sources, period_s)
    unused += [(each.name, NO_MOTOR_VOLTAGE) for each in one_way]
    sources = tuple(each for each in sources if each not in one_way)
    sources += tuple(_sums(sources, period_s))
    notes = (*recorded.notes, *(times.order.notes if times else ()))
    notes += tuple(f"{each.name} is not used: {NO_MOTOR_VOLTAGE}" for each in one_way)
    return ReadingGrid(
        recorded, period_s, times, sources, tuple(unused), joints.chosen, joints.names, notes
    )


OF_BATTERY = NameWords(VOLTAGE, frozenset({"supply"}), typed="V")


def _is_battery(series: Series) -> bool:
    """Whether it is the voltage of a battery, whose other numbers are no readings of a machine."""
    place = series.place
    return place.get("type", "").endswith("/BatteryState") and place["field"] == "voltage"


def _of_quaternions(recorded: RecordedSeries, told: dict[int, NameWords]) -> frozenset[int]:
    series = recorded.series if recorded.is_table else ()
    places = quaternions(series, [told[id(each)] for each in series])
    return frozenset(id(series[k]) for k in places)


def _sources(base: TimeBase, words: list[NameWords], period_s: float) -> Iterator[SeriesSum]:
    """Readings on the grid, angles without their jumps."""
    count = min(MOST_ROWS, int((base.end_s - base.begin_s) / period_s + 1e-6) + 1)
    wanted_s = base.begin_s + np.arange(count) * period_s
    for series, said in zip(base.series, words, strict=True):
        turn = turn_of(series.values) if said.quantity in (POSITION, "") else 0.0
        own = replace(series, values=unwrapped(series.values, turn)) if turn else series
        values = on_grid(own, wanted_s)
        if np.isfinite(values).sum() >= FEWEST_READINGS:
            yield SeriesSum(((own, 1),), said, values, turn=turn)


def _rate(base: TimeBase, words: list[NameWords], times: RowTimes | None) -> float:
    """Rate of the scans: the commonest of what a motor needs, or of anything; by the stamps."""
    told = (CURRENT, EFFORT, TORQUE, POSITION, SPEED)
    known = [
        each
        for each, said in zip(base.series, words, strict=True)
        if said.quantity in told and COMMANDED not in said.qualifiers
    ]
    rates = [r for each in known or base.series if math.isfinite(r := rounded_rate(each.rate_hz))]
    if times is not None and not known:
        rates = [rounded_rate(1.0 / times.period_s)]
    slow = [r for r in rates if r <= FASTEST_HZ * 1.01] or rates
    if not slow:
        raise RecordingError("no series has three readings one after the other; record longer")
    counts = Counter(slow)
    found = max(counts, key=lambda rate: (counts[rate], rate))
    if found > FASTEST_HZ * 1.01:
        return FASTEST_HZ
    if found < SLOWEST_HZ * 0.99:
        raise RecordingError(
            f"readings come at {found:.4g} Hz; scans have {SLOWEST_HZ:g} to {FASTEST_HZ:g} Hz"
        )
    return rounded_rate(found)


class _Twins:
    """Series that were recorded twice under two names."""

    def __init__(self) -> None:
        self._known: dict[tuple[bool, bytes], str] = {}

    def twin_of(self, series: Series, words: NameWords) -> str:
        """Words on the series that this one repeats; a command is no reading."""
        key = COMMANDED in words.qualifiers, series.values.tobytes()
        first = self._known.setdefault(key, series.words)
        return "" if first == series.words else f"the same readings as {first}"


def _unused(
    series: Series, words: NameWords, times: RowTimes | None, joints: RecordedJoints
) -> str:
    """Why a series can be no channel; "" if it can."""
    if times is not None and series.words == times.column:
        return "times of the rows"
    if not series.changes:
        return "constant" if np.isfinite(series.readings).any() else "empty"
    if joints.is_of_another(series):
        return f"of another joint than {joints.chosen}"
    finite = np.isfinite(series.readings)
    if finite.sum() < FEWEST_READINGS:
        return f"{int(finite.sum())} readings alone"
    return no_reading(series, words, times is not None)


def _worded(series: Series, times: RowTimes | None) -> NameWords:
    """Words of the name; a load that stands still in each recording was commanded."""
    place = series.place
    name = place.get("column") or f"{place['topic']}/{place['field']}"
    words = words_of(name, place.get("type", ""), series.unit)
    steady = times is not None and series.words in times.split_by
    if words.quantity in (FORCE, TORQUE) and (steady or _is_stepped(series.readings)):
        words = replace(words, qualifiers=words.qualifiers | {COMMANDED})
    return words


def _is_stepped(values: Array) -> bool:
    """Whether readings are those of a set point that is changed now and then."""
    finite = values[np.isfinite(values)]
    if len(finite) < 2:
        return False
    return len(np.unique(finite)) <= 5 and float(np.mean(np.diff(finite) != 0.0)) < 0.01


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
