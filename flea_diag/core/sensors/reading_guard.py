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
from collections.abc import Iterator, Mapping, Sequence
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from flea_diag.core.backend import FEW
from flea_diag.core.flag_runs import in_a_row
from flea_diag.core.scan_counts import ScanCounts
from flea_diag.core.sensors.own_readings import ReadingTrain
from flea_diag.core.sensors.position_step import SPAN
from flea_diag.core.sensors.rest_watch import STUCK_S, RestWatch
from flea_diag.core.sensors.sensor_limits import DROPOUT_S, REACH_GUARD, SensorLimit

Array = npt.NDArray[np.float64]
Counts = npt.NDArray[np.int64]
Flags = npt.NDArray[np.bool_]

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

    def take_calm(self, readings: Array, inside: Flags, rests: Flags | None) -> Counts:
        """Take leading readings held no longer than chance allows; repeats of each that is taken.

        ``readings`` begins with the one before the first; ``inside`` is where the others are off
        the ends of their range. The same as of ``take``: after each of these holds the guard is as
        it was. One that is not over is left, as is what leaps or is missing.
        """
        if self.busy:
            return np.empty(0, dtype=np.int64)
        before, now = readings[:-1], readings[1:]
        held = (now == before) & inside
        run = in_a_row(held if rests is None else held & ~rests, ~held)
        left = ~(np.abs(now - before) <= self._limit.reach)
        if self._limit.repeats:
            left |= run >= self._limit.repeats
        taken = int(left.argmax()) if left.any() else len(now)
        over = np.flatnonzero(run[:taken] == 0)
        taken = int(over[-1]) + 1 if len(over) else 0
        if (now[:taken] == before[:taken]).any():
            self._went = 0.0  # it has not leapt since: no jump goes on
        return run[:taken]

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


class GuardedScans(NamedTuple):
    """n scans, and what is told of them.

    Attributes
    ----------
    number
        Of the first.
    ends
        Of the range of each tested channel, shape (2, tested).
    odd
        Where one leaps or stands still, shape (n, tested).
    usable, z
        To be filled in: readings, shape (n, channels), and statistics, shape (n, tests).
    """

    number: int
    ends: Array
    odd: Flags
    usable: Array
    z: Array


class ChannelPlaces(NamedTuple):
    """Column of a channel, those of its tests, and that of its steps, if any."""

    column: int
    stuck: int
    dropout: int
    step: int | None


class ReadingGuards:
    """Guards of all tested channels, each called only where its readings are unusual.

    ``quanta`` are those of the guards.
    """

    def __init__(
        self, limits: Sequence[SensorLimit], period_s: float, quanta: Sequence[float],
        places: Sequence[ChannelPlaces],
    ) -> None:  # fmt: skip
        self._limits, self._places = limits, places
        self._guards = [
            ReadingGuard(limit, period_s, quantum)
            for limit, quantum in zip(limits, quanta, strict=True)
        ]
        self._watched: set[int] = set()
        """Channels in which a jump, a hold or a drop-out is still of effect."""
        self.stuck = {limit.channel: 0 for limit in limits}
        """Number of readings of each channel held longer than chance allows."""

    @property
    def busy(self) -> bool:
        """Whether anything is still of effect."""
        return bool(self._watched)

    def interrupt(self) -> None:
        """Forget the readings, not the drop-outs."""
        for guard in self._guards:
            guard.interrupt()

    def step(
        self, scans: GuardedScans, recent: Array, own: Mapping[int, ReadingTrain], rest: RestWatch
    ) -> tuple[bool, Flags | None]:
        """Step through the channels with a jump or a hold, now or until now.

        ``recent``, shape (at least n + 3, tested), ends with these scans; ``own``: readings of
        channels that lack some. Whether any is withheld, and which of these may be outliers.
        """
        count, withheld = len(scans.odd), np.zeros(scans.usable.shape, dtype=bool)
        outlying = withheld.copy()
        told = withheld, outlying
        self._watched.update(np.flatnonzero(scans.odd.any(axis=0)).tolist())
        for index in sorted(self._watched):
            known = rest.of(index)
            rests = [False] * count if known is None else known.tolist()
            if index in own:
                self._hold(index, slice(0, next(iter(own[index].places), count)), scans.z)
                readings, places = own[index].last(3)
                self._follow(index, readings[:, 0].tolist(), places.tolist(), rests, scans, told)
            else:
                readings = recent[-count - 3 :, index]
                taken = 0 if count <= FEW else self._pass(index, readings[2:], known, scans)
                left = readings[taken:].tolist()
                self._follow(index, left, range(taken - 3, count), rests, scans, told)
        self._watched = {index for index in self._watched if self._guards[index].busy}
        return bool(withheld.any()), outlying if outlying.any() else None

    def _pass(self, index: int, readings: Array, rests: Flags | None, scans: GuardedScans) -> int:
        """Pass over leading scans of a channel in which nothing happens; how many."""
        (low, high), now = scans.ends[:, index].tolist(), readings[1:]
        run = self._guards[index].take_calm(readings, (low < now) & (now < high), rests)
        if self._limits[index].repeats:
            scans.z[: len(run), self._places[index].stuck] = run
        return len(run)

    def _follow(
        self, index: int, readings: list[float], numbers: Sequence[int], rests: list[bool],
        scans: GuardedScans, told: tuple[Flags, Flags],
    ) -> None:  # fmt: skip
        """Judge the eventful readings of a channel; ``readings`` begins with three earlier ones."""
        guard, limit, places = self._guards[index], self._limits[index], self._places[index]
        low, high = scans.ends[:, index].tolist()
        withheld, outlying = told
        later = numbers[3:]
        for n in _eventful(scans.odd[later, index], guard):
            value, scan = readings[n + 3], later[n]
            guard.wake(*readings[n : n + 3])
            at_end, gap = not low < value < high, scan - numbers[n + 2]
            refused, leapt = guard.take(scans.number + scan, value, at_end, rests[scan], gap)
            if refused:
                scans.usable[scan, places.column] = math.nan
                withheld[scan, places.column] = True
                # Neither held nor a position's.
                outlying[scan, places.column] = guard.outlying and not guard.run
            self.stuck[limit.channel] += 0 < limit.repeats <= guard.run
            if places.step is not None and guard.disturbed:
                scans.z[scan, places.step] = leapt / limit.step
            end = later[n + 1] if n + 1 < len(later) else None
            self._hold(index, slice(scan, end), scans.z)

    def _hold(self, index: int, scans: slice, z: Array) -> None:
        """What has been counted stands until the next reading."""
        guard, places = self._guards[index], self._places[index]
        if self._limits[index].repeats:
            z[scans, places.stuck], z[scans, places.dropout] = guard.run, len(guard.events)


def _eventful(odd: Flags, guard: ReadingGuard) -> Iterator[int]:
    """Scans with a jump or a hold, and those while one is still of effect on this guard."""
    last, scan = len(odd) - 1, -1
    for begins in (-1, *odd.nonzero()[0].tolist()):
        if begins > scan:
            scan = begins
            yield scan
        while scan < last and guard.busy:
            scan += 1
            yield scan
