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

"""Jumps and held readings of one channel; affected readings are withheld.

A position that jumps by more than its nominal reach is withheld until it has stayed at the new
level for ``HOLD_S``: no machine makes it jump. One that goes on in that direction, faster than any
nominal one, moves. Any other quantity a machine may well make jump, as an opening does a current:
of these the first reading alone is withheld, for it may be an outlier. A reading that repeats more
often than chance allows is withheld while it repeats. A drop-out
thus reaches no derivative and no mean.
"""

from __future__ import annotations

import math
from collections import deque

from flea_diag.core.scan_counts import ScanCounts
from flea_diag.core.sensors.position_step import SPAN
from flea_diag.core.sensors.rest_watch import STUCK_S
from flea_diag.core.sensors.sensor_limits import DROPOUT_S, REACH_GUARD, SensorLimit

HOLD_S = 0.1
"""Time after which a position that jumped is accepted at the new level."""
LEAST_HELD = 2
"""Repeats of a reading that jumped and jumps back which make it a drop-out: no chance meets both
jumps. A reading that does not jump is one after as many repeats as chance allows."""


def stuck_scans(limit: SensorLimit, period_s: float) -> int:
    """Scans after which a held reading counts as stuck; one that comes seldom has no drop-outs."""
    return max(ScanCounts(period_s).of(STUCK_S), (1 + (limit.every == 1)) * limit.repeats)


class ReadingGuard:
    """Detects jumps and held readings of one channel.

    ``quantum``: of a reading that counts, about the size of a count; of a position what it goes by
    at rest. A motion holds it for a moment, too, and it goes on as it came: a drop-out is left by
    more than that, and by more than the reading went in each of the two scans before it.
    """

    def __init__(self, limit: SensorLimit, period_s: float, quantum: float = 0.0) -> None:
        self._limit, self._quantum, counts = limit, quantum, ScanCounts(period_s)
        self._stuck = stuck_scans(limit, period_s)
        self._hold = counts.of(HOLD_S)
        self._memory = counts.of(DROPOUT_S)
        self.events: deque[int] = deque()
        self.interrupt()

    def interrupt(self) -> None:
        """Forget the readings, not the drop-outs."""
        self._last = self._level = self._speed = math.nan
        self._leapt = self._went = self._step = 0.0
        self._came = (0.0, 0.0)
        self._away = self._calm = self.run = 0

    @property
    def busy(self) -> bool:
        """Whether a jump, a hold or a counted drop-out is still of effect."""
        return bool(self.run or self._away or self.events or self._calm)

    @property
    def outlying(self) -> bool:
        """Whether it has just jumped and may go back; not of a position."""
        return self._away == 1 and self._limit.step == 0.0

    @property
    def disturbed(self) -> bool:
        """Whether a jump lies within the window of the step test."""
        return self._calm > 0 or self._away > 0

    def wake(self, first: float, before: float, last: float) -> None:
        """Set the three readings before the next one, if none of them was unusual."""
        if not self.busy:
            self._last, self._level, self._speed = last, last, last - before
            self._step = abs(last - before)
            self._came = abs(before - first), self._step

    def stand(self) -> None:
        """The reading has been held, and has not leapt since: no jump goes on."""
        self._went = 0.0

    def take(
        self, scan: int, value: float, at_end: bool, rests: bool = False, gap: int = 1
    ) -> tuple[bool, float]:
        """Judge one reading: whether it is withheld, and the size of a confirmed jump (else 0).

        While the actuator ``rests`` a held reading is not counted. ``gap``: scans since the reading
        before; those that are missing are none.
        """
        while self.events and self.events[0] <= scan - self._memory:
            self.events.popleft()
        leapt = self._leap(scan, value - self._last, gap * self._limit.reach)
        held = self._held(scan, value, at_end, rests)
        jumps = self.outlying or (self._away > 0 and self._limit.step > 0.0)
        return held or jumps, leapt

    def _held(self, scan: int, value: float, at_end: bool, rests: bool) -> bool:
        least = self._limit.repeats
        if value == self._level and not at_end:
            self.run += not rests
            self._step = 0.0
        else:
            went = abs(value - self._level)
            goes_on = self._quantum > 0.0 and went <= max(self._quantum, min(self._came))
            if least and least <= self.run < self._stuck and not goes_on:
                self.events.append(scan)
            self.run, self._came, self._step = 0, (self._step, went), went
        self._last = self._level = value
        return bool(least) and self.run >= least

    def _leap(self, scan: int, change: float, reach: float) -> float:
        """Track a reading that jumped; its step once it has stayed at the new level, else 0."""
        leaps, leapt = abs(change) > reach, 0.0
        goes_on = change * self._went > 0.0 and REACH_GUARD * abs(change) > reach
        self._went = change if leaps or goes_on else 0.0
        self._calm = max(self._calm - 1, 0)
        if goes_on:
            self._away, self._speed = 0, change
        elif leaps and self._away and change * self._leapt < 0.0:
            if LEAST_HELD <= self.run < self._limit.repeats:
                self.events.append(scan)
            self._away, self._calm = 0, 2 * SPAN
        elif leaps and not self._away:
            self._away = 1
            self._leapt = change - (self._speed if self._speed == self._speed else 0.0)
        elif self._away > self._hold:
            self._away, self._calm, leapt = 0, 2 * SPAN, self._leapt
        elif self._away:
            self._away += 1
        else:
            self._speed = change
        return leapt
