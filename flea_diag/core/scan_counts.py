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

"""How many scans the times of the method are, at the rate of a stand.

Windows, smoothing and the least evidence of a decision are stated in seconds, so that a fault
shows after the same time at any rate. What rests on the number of readings alone, such as an
estimate of noise, is a count.
"""

from __future__ import annotations

from dataclasses import dataclass

from flea_diag.core.frozen import Frozen

COUNTED_PERIOD_S = 0.01
"""Period by which calibrations that state none count at any rate: of the first stand."""
SMOOTHING_S = 0.3
"""Length of the smoothing kernel where a description states none; half of it is its delay."""
SMOOTHINGS_S = (0.01, 10.0)
"""Shortest and longest that can be stated."""


@dataclass(frozen=True, slots=True)
class ScanCounts(Frozen):
    """Counts of scans that follow each other by ``period_s``, smoothed over ``smoothing_s``."""

    period_s: float
    smoothing_s: float = SMOOTHING_S

    def of(self, time_s: float) -> int:
        """Scans in a time, at least one."""
        return max(1, round(time_s / self.period_s))

    @property
    def kernel(self) -> int:
        """Length of the smoothing kernel: odd, and at least the five that a curvature takes."""
        return 1 + 2 * max(2, round(0.5 * self.smoothing_s / self.period_s))
