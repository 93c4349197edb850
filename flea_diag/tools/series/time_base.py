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

"""The times of all series of a recording on one axis: recordings and gaps laid end to end."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from flea_diag.tools.series.recorded_series import Series
from flea_diag.tools.series.row_times import RowTimes

Array = npt.NDArray[np.float64]

LONGEST_GAP_S = 10.0
"""A longer gap is shortened to this: a recording begins anew, or a clock was set."""
BACK_S = 1.0
"""Step back of a clock from which on a recording begins anew."""
READINGS = 3.0
"""Steps between readings that are bridged."""


@dataclass(frozen=True, eq=False)
class TimeBase:
    """Series with times that rise, and how long the whole is."""

    series: tuple[Series, ...]
    begin_s: float
    end_s: float


def of_table(series: Sequence[Series], times: RowTimes) -> TimeBase:
    """Columns by the stamps of their rows; cells without a reading are left out."""
    order = times.order
    rows = np.concatenate(order.parts)
    laid, begin_s = [], 0.0
    for part in order.parts:
        own = order.seconds[part]
        laid.append(own - own[0] + begin_s)
        begin_s = float(laid[-1][-1]) + LONGEST_GAP_S
    at_s = _without_long_gaps(np.concatenate(laid))
    found = []
    for each in series:
        values = each.readings[rows]
        finite = np.isfinite(values)
        found.append(replace(each, times_s=at_s[finite], values=values[finite]))
    return TimeBase(tuple(found), 0.0, float(at_s[-1]))


def of_bag(series: Sequence[Series]) -> TimeBase:
    """Fields by the stamps of their messages; where a clock was set back, a recording begins."""
    known: dict[int, Array] = {}
    for each in series:
        if id(each.times_s) not in known:
            known[id(each.times_s)] = _rising(each.times_s)
    stamps = np.unique(np.concatenate([*known.values(), np.zeros(0)]))
    shortened = _without_long_gaps(stamps)
    found = []
    for each in series:
        at_s = np.interp(known[id(each.times_s)], stamps, shortened)
        values = each.readings
        rows = np.argsort(at_s, kind="stable")
        rows = rows[np.isfinite(values[rows])]
        rows = rows[np.concatenate([[True], np.diff(at_s[rows]) > 0.0])] if len(rows) else rows
        found.append(replace(each, times_s=at_s[rows], values=values[rows]))
    end_s = float(shortened[-1]) if len(shortened) else 0.0
    return TimeBase(tuple(found), float(shortened[0]) if len(shortened) else 0.0, end_s)


def _rising(times_s: Array) -> Array:
    """Times of which no longer run lies before what was read."""
    steps = np.diff(times_s)
    back = np.flatnonzero(steps < -BACK_S)
    shifted = times_s.copy()
    for step in back.tolist():
        later = shifted[step + 1 :]
        # A single stamp that leaps back is an error; a run of them is a clock that was set.
        if len(later) >= 10 and bool((later[:10] < shifted[step] - BACK_S).all()):
            shifted[step + 1 :] += float(shifted[step] - shifted[step + 1]) + LONGEST_GAP_S
    return shifted


def _without_long_gaps(times_s: Array) -> Array:
    steps = np.diff(times_s)
    return (
        np.concatenate([times_s[:1], times_s[0] + np.cumsum(np.minimum(steps, LONGEST_GAP_S))])
        if len(times_s)
        else times_s
    )


def bridged_s(series: Series) -> float:
    """Longest break between two readings that is bridged."""
    steps = np.diff(series.times_s)
    if not len(steps):
        return 0.0
    median = float(np.median(steps))
    usual = float(np.quantile(steps, 0.99))
    return max(READINGS * median, min(1.2 * usual, 1.0) if usual < LONGEST_GAP_S else 0.0)


def on_grid(series: Series, wanted_s: Array) -> Array:
    """Readings at these times: on the line between the two about it; NaN in a gap."""
    at_s, values = series.times_s, series.values
    if len(at_s) < 2:
        return np.full(len(wanted_s), np.nan)
    found = np.interp(wanted_s, at_s, values, left=np.nan, right=np.nan)
    after = np.clip(np.searchsorted(at_s, wanted_s, side="left"), 1, len(at_s) - 1)
    gap = at_s[after] - at_s[after - 1]
    inside = (gap <= bridged_s(series) * (1.0 + 1e-9)) | np.isclose(at_s[after], wanted_s)
    return np.asarray(np.where(inside, found, np.nan))
