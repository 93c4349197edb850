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

"""Tests of single sensors against their nominal behaviour: noise, holds, drop-outs, steps.

No plant fault affects these tests. The limits are those of ``sensor_limits``. Rows come one by
one or in blocks, with identical results.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from flea_diag.core import backend as backends
from flea_diag.core.flat_state import FlatState
from flea_diag.core.scan_counts import ScanCounts
from flea_diag.core.sensors.held_reading import HeldReadings
from flea_diag.core.sensors.noise_test import NoiseTest
from flea_diag.core.sensors.own_readings import (
    KEPT,
    OwnReadings,
    ReadingTrain,
    train_steps,
    unusual,
)
from flea_diag.core.sensors.position_step import TurnedPosition, position_steps
from flea_diag.core.sensors.reading_guard import (
    ChannelPlaces,
    GuardedScans,
    ReadingGuards,
    stuck_scans,
)
from flea_diag.core.sensors.rest_watch import REST_S, RestWatch
from flea_diag.core.sensors.sensor_limits import NOISE_WINDOWS, SensorLimit
from flea_diag.core.sensors.sensor_loops import LOOKS
from flea_diag.core.sensors.sensor_set import TESTS, SensorSet

Array = npt.NDArray[np.float64]
Counts = npt.NDArray[np.int64]
Flags = npt.NDArray[np.bool_]

TWICE = 1.5
"""Limit of the number of drop-outs: the second one exceeds it."""
RUSH = 4
"""Scans in a row in which all positions that are not held go farther than in any healthy scan, one
way: the actuator has run away. Noise hardly goes one way four times. An assumption."""


@dataclass(slots=True)
class SensorTestResults:
    """Results for a block of n rows.

    ``usable``: readings without the withheld ones, shape (n, channels). ``z``: test statistics,
    shape (n, tests), NaN where there is no test; ``k``: their limits, shape (tests,).
    """

    usable: Array
    z: Array
    k: Array


class SensorTests:
    """Runs the tests on a stream of rows, constant memory.

    Parameters
    ----------
    limits : nominal behaviour; a channel without one is not tested
    channels : names of the columns of a row
    sensors : what is tested; its names are those of the columns of ``SensorTestResults.z``
    period_s : time between two rows
    counts : those that the limits hold for
    turned : the position that the motor turns directly, and by how much in a scan for its speed
    """

    away: Flags | None = None
    """In which of the last rows the actuator had run away; None: in none."""
    outlying: Flags | None = None
    """Which of the last readings are withheld for they may be outliers; None: none. Those beside
    such a one say what it should have been, as where one is lost."""

    def __init__(
        self,
        limits: Sequence[SensorLimit],
        channels: Sequence[str],
        sensors: SensorSet,
        backend: str = "auto",
        *,
        period_s: float,
        counts: ScanCounts,
        turned: tuple[str, float] = ("", 0.0),
    ) -> None:
        names, self._sensors = sensors.names, sensors
        self._compiled = backends.chosen(backend) == "numba"
        tested = set(channels) & set(sensors.resolutions)
        self._limits = tuple(limit for limit in limits if limit.channel in tested)
        self._names = [limit.channel for limit in self._limits]
        self._columns = np.array([channels.index(name) for name in self._names], dtype=int)
        self._reach = np.array([limit.reach for limit in self._limits])
        still = {**sensors.positions, sensors.speed: sensors.speed_of_a_count(period_s)}
        quanta = [still.get(name, 0.0) for name in self._names]
        self._noise = NoiseTest(self._limits, sensors, backend)
        self._recent = np.full((KEPT, len(self._limits)), np.nan)
        unseen = [limit.channel for limit in self._limits if not limit.rested]
        self._rest = RestWatch(self._names, unseen, sensors, counts.of(REST_S))
        self._scan = 0
        self._rushed, self._rushing = -NOISE_WINDOWS[0], False
        """Last scan in which the actuator ran away, and whether that is still of effect."""
        self.withholds = False
        """Whether any of the last readings is withheld."""
        self._places = {
            test: np.array([names.index(f"{name}_{test}") for name in self._names], dtype=int)
            for test in TESTS
        }
        self._prepare_steps(sensors)
        self._turned = self._turned_by(*turned)
        steps = {index: place for place, index in self._steps}
        held = (self._places[test].tolist() for test in TESTS[1:])
        places = [
            ChannelPlaces(column, stuck, dropout, steps.get(index))
            for index, (column, stuck, dropout) in enumerate(
                zip(self._columns.tolist(), *held, strict=True)
            )
        ]
        self._guards = ReadingGuards(self._limits, period_s, quanta, places)
        self.k = self._all_limits(len(names), period_s)
        self._calm = np.where(np.isnan(self.k), np.nan, 0.0)
        self._held = HeldReadings(limits, channels, sensors, period_s)
        self.k[self._held.places] = self._held.k
        self._state = self._tables()

    def _tables(self) -> FlatState:
        """What ``look_loops`` looks by."""
        ends = np.full((2, len(self._limits)), [[-math.inf], [math.inf]])
        numbers = {
            "bounds": np.vstack((ends, self._reach)), "calm": self._calm, "sizes": self._sizes,
        }  # fmt: skip
        turned = -1 if self._turned is None else self._turned.place
        counts = {
            "columns": self._columns, "positions": self._stepping, "places": self._step_places,
            "heard": self._places["noise"], "paired": self._paired, "turned": turned,
        }  # fmt: skip
        return FlatState(numbers, counts)

    @property
    def stuck(self) -> Mapping[str, int]:
        """Number of readings of each channel held longer than chance allows."""
        return self._guards.stuck

    @property
    def _bounds(self) -> Array:
        """Ends of the range of each reading, and how far it goes in a scan."""
        return self._state.table["bounds"]

    def _prepare_steps(self, sensors: SensorSet) -> None:
        """Which positions are looked at for steps, and which readings belong together."""
        self._steps = [
            (sensors.names.index(limit.channel), index)
            for index, limit in enumerate(self._limits)
            if limit.step > 0.0 and limit.channel in sensors.names
        ]
        self._paired = sensors.paired and len(self._steps) == 2
        stepping = [index for _, index in self._steps]
        self._step_groups = [tuple(stepping)] if self._paired else [(k,) for k in stepping]
        every = [(index,) for index in range(len(self._limits))]
        self._readings = OwnReadings(list(dict.fromkeys((*every, *self._step_groups))))
        self._step_places = np.array([place for place, _ in self._steps], dtype=int)
        self._stepping = np.array([index for _, index in self._steps], dtype=int)
        self._sizes = np.array([self._limits[index].step for _, index in self._steps])

    def _turned_by(self, position: str, way: float) -> TurnedPosition | None:
        """The position that the motor turns directly, where it is tested beside the speed."""
        for place, index in self._steps:
            if self._names[index] == position and way and self._sensors.speed in self._names:
                speed = self._names.index(self._sensors.speed)
                return TurnedPosition(place, index, speed, way, self._limits[index].step)
        return None

    def _all_limits(self, count: int, period_s: float) -> Array:
        k = np.full(count, np.nan)
        for limit, noise, stuck, dropout in zip(
            self._limits, *(self._places[test] for test in TESTS), strict=True
        ):
            k[noise] = limit.k
            if limit.repeats:
                k[stuck], k[dropout] = stuck_scans(limit, period_s), TWICE
        k[self._step_places] = 1.0
        return k

    def bound(self, channel: str, low: float, high: float) -> None:
        """Set the range of a channel: a reading at its end is clipped, neither held nor quiet."""
        if channel in self._names:
            index = self._names.index(channel)
            self._bounds[:2, index] = low, high

    def interrupt(self) -> None:
        """A gap in the stream: no test spans it."""
        self._recent[:] = np.nan
        self._rest.interrupt()
        self._readings.interrupt()
        self._held.interrupt()
        self._guards.interrupt()

    def step(self, rows: Array) -> SensorTestResults:
        """Test n >= 1 rows, shape (n, channels), one after the other."""
        count, columns = len(rows), len(self._columns)
        recent = np.empty((len(self._recent) + count, columns))
        inside, odd = np.empty((count + 3, columns)), np.empty((count, columns), dtype=bool)
        usable, z = rows.copy(), np.empty((count, len(self._calm)))
        look = backends.exact(*LOOKS) if self._compiled else self._look
        hears = not (self._rushing or self._rest.unseen) and self._noise.takes(count)
        anywhere, lacks, heard, turned, self.withholds = look(
            rows, self._state.flat, (hears, self._noise.memory), self._held.tables, self._recent,
            recent, inside, usable, z, odd,
        )  # fmt: skip
        self._recent, self.outlying = recent[count:], None
        self._rest.step(recent, count, not lacks and self._rest.scans <= KEPT)
        own: dict[int, ReadingTrain] = {}
        void: Flags | None = None
        if heard:
            self._noise.taken(count)
            self._readings.interrupt()
        else:
            anywhere, own, void = self._apart(anywhere, lacks, recent, inside, z, odd)
            turned = self._turned is not None
        if turned and self._turned is not None:
            self._turned.stand_beside_speed(recent, z)
        if anywhere or self._guards.busy:
            scans = GuardedScans(self._scan, self._bounds[:2], odd, usable, z)
            withheld, self.outlying = self._guards.step(scans, recent, own, self._rest)
            self.withholds |= withheld
        if void is not None:
            z[np.ix_(void, self._step_places)] = 0.0
        self.away = void
        self._scan += count
        return SensorTestResults(usable, z, self.k)

    def _apart(
        self, anywhere: bool, lacks: bool, recent: Array, inside: Array, z: Array, odd: Flags
    ) -> tuple[bool, dict[int, ReadingTrain], Flags | None]:
        """Channels that lack readings, a motion that rushes, and the noise of all.

        Whether anything leaps or stands still, the readings of the former, and where it rushes.
        """
        trains = self._readings.step(self._scan, recent, len(z), lacks)
        own = {group[0]: train for group, train in trains.items() if len(group) == 1}
        if trains:
            anywhere |= self._look_apart(trains, own, z, odd)
        leaps = self._rushing or (anywhere and odd[:, self._stepping].any())
        void = self._rushes(recent, inside) if leaps else None
        self._rest.leave_out(inside)
        noise = self._noise.own(own, inside)
        z[:, self._places["noise"]] = self._noise.step(inside, noise)
        return anywhere, own, void

    def _rushes(self, recent: Array, inside: Array) -> Flags:
        """In which scans steps are not judged, shape (n,); their noise is taken out of ``inside``.

        Nominal recordings say nothing of a motion faster than any in them, nor of the impact in
        which it ends: from its beginning until a noise window after it no sensor is blamed.
        """
        count = len(inside) - 3
        ways = np.diff(recent[-(count + 3 + RUSH) :, self._stepping], axis=0)
        far = np.where(np.abs(ways) > self._reach[self._stepping], np.sign(ways), 0.0)
        ends = [slice(k, k + count + 3) for k in range(RUSH)]
        runs = np.abs(sum(far[end] for end in ends)) == RUSH
        held = np.all([ways[end] == 0.0 for end in ends], axis=0)
        rush = (runs | held).all(axis=1) & runs.any(axis=1)
        at = self._scan - 3 + np.arange(count + 3)
        last = np.maximum.accumulate(np.where(rush, at, self._rushed))
        void = at - last < NOISE_WINDOWS[0]
        inside[void] = np.nan
        self._rushed, self._rushing = int(last[-1]), bool(void[-1])
        return np.asarray(void[3:])

    def _look(
        self,
        rows: Array,
        tables: object,
        noise: object,
        held: object,
        before: Array,
        recent: Array,
        inside: Array,
        usable: Array,
        z: Array,
        odd: Flags,
    ) -> tuple[bool, bool, bool, bool, bool]:
        """``sensor_loops.look_loops`` in numpy, which leaves the noise to ``NoiseTest``."""
        count, (low, high, reach) = len(rows), self._bounds
        recent[:-count], recent[-count:], z[:] = before, rows[:, self._columns], self._calm
        last = recent[-count - 3 :]
        inside[:] = np.where((last > low) & (last < high), last, np.nan)
        steps = zip(self._step_places, self._sizes, self._own_steps(recent), strict=True)
        for place, size, step in steps:
            z[:, place] = step / size
        earlier, now = recent[-count - 1 : -1], recent[-count:]
        odd[:] = (np.abs(now - earlier) > reach) | (now == earlier)
        lacks, withheld = bool(np.isnan(recent).any()), self._held.step(rows, usable, z)
        return bool(odd.any()), lacks, False, True, withheld

    def _look_apart(
        self,
        trains: Mapping[tuple[int, ...], ReadingTrain],
        own: Mapping[int, ReadingTrain],
        z: Array,
        odd: Flags,
    ) -> bool:
        """The same of channels that lack readings: of each its own are looked at."""
        for index, train in own.items():
            odd[:, index] = False
            odd[train.places, index] = unusual(train, self._reach[index])
        for group in self._step_groups:
            if group in trains:
                places = [place for place, index in self._steps if index in group]
                sizes = [self._limits[index].step for index in group]
                steps = without_shared(list(train_steps(trains[group]).T))
                enough = trains[group].count(len(z)) >= KEPT
                z[:, places] = np.where(enough, 0.0, np.nan)[:, None]
                z[trains[group].places[:, None], places] = np.transpose(steps) / sizes
        return bool(odd.any())

    def _own_steps(self, recent: Array) -> list[Array]:
        """Step of each position; the part that two of them share is motion, e.g. an impact."""
        steps = [position_steps(recent[:, index]) for _, index in self._steps]
        return without_shared(steps) if self._paired else steps


def without_shared(steps: Sequence[Array]) -> list[Array]:
    """Steps of one position, or of two without what they share: that is motion."""
    if len(steps) < 2:
        return list(steps)
    one, other = steps
    alike = np.where(one * other > 0.0, np.minimum(np.abs(one), np.abs(other)), 0.0)
    return [step - np.copysign(alike, step) for step in steps]
