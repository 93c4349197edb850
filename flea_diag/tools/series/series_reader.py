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

"""Reads all series of a recording, a table or a bag."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from flea_diag.errors import RecordingError
from flea_diag.tools.series.recorded_bag import recorded_bag
from flea_diag.tools.series.recorded_series import RecordedSeries, Series
from flea_diag.tools.tables.readers import read_table, suffix_of

MOST_SERIES = 400


def recorded_series(path: Path) -> RecordedSeries:
    """Read all series of a table or bag.

    Raises
    ------
    RecordingError
        It cannot be read, or holds no series of numbers.
    """
    found = _of_table(path) if suffix_of(path) else recorded_bag(path)
    if not found.series:
        has = ", ".join(found.silent[:20]) or "nothing"
        raise RecordingError(f"{path} holds no series of numbers to make channels of, only {has}")
    return found


def _of_table(path: Path) -> RecordedSeries:
    table = read_table(path)
    if len(table.columns) > MOST_SERIES:
        raise RecordingError(
            f"{path} has {len(table.columns)} columns, at most {MOST_SERIES} are read: leave those "
            "of other parts out"
        )
    count = len(next(iter(table.columns.values()), ()))
    rows = np.arange(count, dtype=np.float64)
    series = tuple(
        Series({"column": name}, rows, values, table.units.get(name, ""), name in table.moments)
        for name, values in table.columns.items()
    )
    return RecordedSeries(path, True, series, table.texts, table.notes)
