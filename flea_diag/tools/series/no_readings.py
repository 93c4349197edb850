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

"""Series that no sensor fills, whatever their name: counters, states, times, quaternions."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from flea_diag.tools.series.recorded_series import Series
from flea_diag.tools.series.row_times import is_called_time
from flea_diag.tools.series.series_words import OTHER, NameWords

Array = npt.NDArray[np.float64]
MOST_STATES = 20
LONG_STATES = 10.0
"""Readings in turn that numbers of states keep, on average."""
EVEN = 0.99999
"""Correlation with the number of the row from which on a series rises evenly."""
UNIT_NORM = 0.01
"""Deviation of the length of a quaternion from one."""


def no_reading(series: Series, words: NameWords, is_table: bool) -> str:
    """Why a series is of no sensor; "" if it may be."""
    values = series.readings[np.isfinite(series.readings)]
    if is_table and words.quantity in ("", OTHER) and is_called_time(series):
        return "a time"
    if len(values) < 3 or words.quantity not in ("", OTHER):
        return ""
    steps = np.diff(values)
    whole = bool((values == np.round(values)).all())
    if whole and float(np.mean(steps == 1.0)) > 0.9:
        return "it counts"
    if words.quantity == OTHER:
        return ""
    if whole and len(np.unique(values)) <= MOST_STATES:
        changes = int(np.count_nonzero(steps))
        if len(values) > LONG_STATES * max(1, changes):
            return "numbers of a state"
    if float(np.corrcoef(values, np.arange(len(values)))[0, 1]) > EVEN:
        return "it rises evenly, as times and counters do"
    return ""


def quaternions(series: Sequence[Series], words: Sequence[NameWords]) -> frozenset[int]:
    """Places of four series in turn whose squares add up to one."""
    found: set[int] = set()
    for start in range(len(series) - 3):
        four = range(start, start + 4)
        if any(words[k].quantity not in ("", OTHER) for k in four):
            continue
        parts = [series[k].readings for k in four]
        if len({len(part) for part in parts}) > 1 or any(np.abs(p[:1]).max() > 1.01 for p in parts):
            continue
        norm = np.sqrt(sum(part * part for part in parts))
        if bool(np.all(np.abs(norm[np.isfinite(norm)] - 1.0) < UNIT_NORM)):
            found.update(four)
    return frozenset(found)
