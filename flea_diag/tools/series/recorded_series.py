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

"""Every series of numbers in a recording, with the place that a channel mapping names it by."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt

from flea_diag.core.calibration.power_balance import LARGEST

Array = npt.NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Series:
    """One column of a table, or one field of a topic.

    Parameters
    ----------
    place
        Keys of a channel in channels.yaml: ``column``, or ``topic``, ``type`` and ``field``.
    times_s, values
        Shape (n,) each; NaN where a message or row has no value.
    unit
        Its unit, where the table has a row of units.
    is_moment
        Whether it was written as dates or times of day.
    """

    place: Mapping[str, str]
    times_s: Array
    values: Array
    unit: str = ""
    is_moment: bool = False

    @property
    def words(self) -> str:
        """The place as people name it."""
        if "column" in self.place:
            return self.place["column"]
        return f"{self.place['topic']} {self.place['field']}"

    @property
    def rate_hz(self) -> float:
        """Readings a second; NaN for fewer than three."""
        steps = np.diff(self.times_s)
        steps = steps[steps > 0.0]
        return 1.0 / float(np.median(steps)) if len(steps) > 1 else math.nan

    @property
    def readings(self) -> Array:
        """Readings that a sensor can have: NaN elsewhere."""
        return np.where(np.abs(self.values) < LARGEST, self.values, np.nan)

    @property
    def changes(self) -> bool:
        """Whether it has two readings that differ."""
        finite = self.readings[np.isfinite(self.readings)]
        return len(finite) > 1 and float(finite.min()) < float(finite.max())


@dataclass(frozen=True, eq=False)
class RecordedSeries:
    """What a recording holds.

    Parameters
    ----------
    path, is_table
        The file, and whether it is a table or a bag.
    series
        All series of numbers.
    silent
        Columns and topics that hold no numbers that a channel could be.
    notes
        What was done so that it could be read, a line each.
    """

    path: Path
    is_table: bool
    series: tuple[Series, ...]
    silent: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()
