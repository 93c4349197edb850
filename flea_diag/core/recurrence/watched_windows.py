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

"""What is kept of a stream in which something comes and goes."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
import numpy.typing as npt

from flea_diag.core.recurrence.recurring import StreamPart

Array = npt.NDArray[np.float64]


@dataclass
class WatchedWindows:
    """Windows of a stream since something was first far out.

    Attributes
    ----------
    ends_ns
        Stamps of their last scans.
    errors, faults, units
        See ``WindowRow``.
    ways, jumps
        See ``StreamPart``.
    places
        Along the stroke, NaN where nothing reads it.
    """

    ends_ns: list[int] = field(default_factory=list)
    errors: list[Array] = field(default_factory=list)
    faults: list[Array] = field(default_factory=list)
    units: list[Array] = field(default_factory=list)
    ways: list[tuple[float, float]] = field(default_factory=list)
    jumps: list[Array] = field(default_factory=list)
    places: list[float] = field(default_factory=list)

    def __len__(self) -> int:
        return len(self.ends_ns)

    def drop(self, count: int) -> None:
        """Forget the oldest."""
        every: tuple[list[Any], ...] = (
            self.ends_ns, self.errors, self.faults, self.units, self.ways, self.jumps,
            self.places,
        )  # fmt: skip
        for rows in every:
            del rows[:count]

    def part(self, shape: tuple[int, int]) -> StreamPart:
        """All of them."""
        faults = np.array(self.faults).reshape(len(self.faults), -1, *shape)
        units, ways, jumps = map(np.array, (self.units, self.ways, self.jumps))
        return StreamPart(np.array(self.errors), faults, units, ways, jumps)
