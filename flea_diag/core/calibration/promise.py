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

"""What a calibration can promise: the rate of false alarms that its recordings support.

``n`` false alarms in ``T`` hours of nominal recordings bound the rate of a Poisson process from
above by ``gammaincinv(n + 1, confidence) / T`` (Garwood 1936; with no alarm and 95 % this is
3.0 / T, the rule of three). The stated rate is what the limits were set for; what lies between the
two is extrapolated.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

CONFIDENCE = 0.95  # the usual one; the words that are printed state it
FALSE_ALARMS_PER_HOUR = 0.1
"""Stated rate, unless another is asked for."""
LEAST_RECORDINGS = 3
"""Fewer cannot be judged by limits that were learned without them."""


@dataclass(frozen=True, slots=True)
class FalseAlarmPromise:
    """Stated rate, and the recordings that it rests on: their number, hours and false alarms."""

    stated_per_hour: float
    recordings: int
    hours: float
    alarms: int = 0

    @property
    def supported_per_hour(self) -> float:
        """Upper bound of the rate; infinity where there are too few recordings to state one."""
        if self.recordings < LEAST_RECORDINGS or not self.hours > 0.0:
            return math.inf
        return _most_expected(self.alarms) / self.hours

    @property
    def needed_hours(self) -> float:
        """Hours without a false alarm that would support the stated rate."""
        return _most_expected(0) / self.stated_per_hour

    def words(self) -> str:
        """Stated and supported rate with their ground."""
        stated = f"{self.stated_per_hour:g} false alarms per hour stated"
        if math.isinf(self.supported_per_hour):
            return (
                f"{stated}, no rate supported: {self.recordings} nominal recordings, at least "
                f"{LEAST_RECORDINGS} needed"
            )
        seen = f"{self.alarms or 'no'} false alarm{'s' if self.alarms > 1 else ''}"
        return (
            f"{stated}, at most {self.supported_per_hour:.2g} supported ({CONFIDENCE:.0%}, {seen} "
            f"in {self.hours:.2g} h of nominal recordings)"
        )


def _most_expected(alarms: int) -> float:
    """Upper bound of the expected number of alarms where so many were seen.

    Its Poisson distribution has no more than 1 - CONFIDENCE up to them.
    """
    low, high = float(alarms), 10.0 * (alarms + 1)
    while low < (middle := 0.5 * (low + high)) < high:
        logs = (k * math.log(middle) - middle - math.lgamma(k + 1) for k in range(alarms + 1))
        beyond = sum(map(math.exp, logs)) < 1.0 - CONFIDENCE
        low, high = (low, middle) if beyond else (middle, high)
    return high
