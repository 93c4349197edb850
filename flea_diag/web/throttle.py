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

"""Rate limit by client, for token attempts and page loads.

The number of counts is bounded: beyond it, all further addresses share one count.
"""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable

MOST_ASKERS = 1000
OTHERS = ""


class Throttle:
    """Sliding-window rate limit for each client.

    Parameters
    ----------
    most
        Requests allowed within ``period_s``.
    clock
        Monotonic clock, s.
    """

    def __init__(
        self, most: int, period_s: float, clock: Callable[[], float] = time.monotonic
    ) -> None:
        self._most, self._period_s, self._clock = most, period_s, clock
        self._times: dict[str, deque[float]] = {}

    def passes(self, who: str) -> bool:
        """Whether one more request is allowed; if so, it is counted."""
        times = self._recent(who)
        if len(times) >= self._most:
            return False
        times.append(self._clock())
        return True

    def _recent(self, who: str) -> deque[float]:
        if who not in self._times and len(self._times) >= MOST_ASKERS:
            self._forget()
            who = who if len(self._times) < MOST_ASKERS else OTHERS
        times = self._times.setdefault(who, deque())
        begin = self._clock() - self._period_s
        while times and times[0] <= begin:
            times.popleft()
        return times

    def _forget(self) -> None:
        """Drop clients without recent requests."""
        begin = self._clock() - self._period_s
        self._times = {
            who: times for who, times in self._times.items() if times and times[-1] > begin
        }
