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

"""The noise of each sensor against the loudest and the quietest that nominal recordings know.

An F-test on a logarithmic scale: the mean logarithm of what is left of the readings once
motion is taken out, with the scatter of a healthy sensor's own mean as the yardstick. This
unit's own first seconds count, too: a sensor that has always been louder is no fault.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np
import numpy.typing as npt

from flea_diag.core import backend as backends
from flea_diag.core.flat_state import FlatState
from flea_diag.core.row_ring import RowRing
from flea_diag.core.sensors.noise_loops import NOISE_LOOPS, Memory
from flea_diag.core.sensors.own_readings import ReadingTrain, longest_gaps, train_logs
from flea_diag.core.sensors.sensor_limits import (
    NOISE_WINDOWS,
    QUIETER_LOG,
    UNIT_LOG,
    SensorLimit,
    noise_logs,
)
from flea_diag.core.sensors.sensor_set import SensorSet

Array = npt.NDArray[np.float64]
Counts = npt.NDArray[np.int64]
Flags = npt.NDArray[np.bool_]
Own = tuple[Flags, Array, Flags]
"""Which channels lack readings, shape (channels,); the logarithm of the noise of each of their
readings, NaN where it cannot be told, and where they have none, both of shape (n, channels)."""

WARM_UP_SCANS = 600  # assumption: size of a sample
LARGEST_BASELINE = 0.7
"""Most extra noise learned from this unit's first seconds, over nominal (logarithm)."""
LOG_SCATTER = math.pi / math.sqrt(8.0)
"""Scatter of the logarithm of one sample of white noise. A sensor whose noise lies below its
resolution shows none in nominal recordings, and would be noisy with the first sample above it."""
CLIP_LOG = 2.0
"""Cap of one sample's excess over the highest nominal level (logarithm)."""


LENGTHS = np.array(NOISE_WINDOWS)
WINDOWS = LENGTHS[:, None]


class NoiseTest:
    """Means of the logarithm of the noise, against the loudest and the quietest nominal level.

    Sums are kept in whole millionths, so that they are exact in whatever order they are made,
    by numpy or by numba (``backend``).
    """

    def __init__(
        self, limits: Sequence[SensorLimit], sensors: SensorSet, backend: str = "auto"
    ) -> None:
        self._compiled = backends.chosen(backend) == "numba"
        count = len(limits)
        self._resolution = np.array([sensors.resolutions[limit.channel] for limit in limits])
        self._loudest = np.array([limit.loudest for limit in limits])
        self._most = self._loudest + CLIP_LOG
        self._quietest = np.array([limit.quietest for limit in limits])
        self._floor = self._quietest - QUIETER_LOG
        self._every = np.array([limit.every for limit in limits])
        scatter = np.array([max(limit.scatter, LOG_SCATTER) for limit in limits])
        self._sigma = scatter / np.sqrt(WINDOWS)
        self._rows = RowRing(2 * count, NOISE_WINDOWS, np.int64)
        self._whole = np.zeros(count, dtype=bool), np.empty((0, count)), np.empty((0, count), bool)
        self._scans = 0
        self._sound: dict[int, Flags] = {}
        """Of channels that lack readings, which of their last three are inside their range."""
        # During its first seconds a unit may be as noisy as any unit.
        self._ceiling = self._loudest + UNIT_LOG + LARGEST_BASELINE
        levels = self._resolution, self._most, self._ceiling, self._floor
        self._state = FlatState(
            {"levels": levels, "sigma": self._sigma},
            {
                "lengths": LENGTHS, "sums": np.zeros((len(LENGTHS), 2 * count)),
                "first": np.zeros(2 * count),
            },
        )  # fmt: skip

    def step(self, recent: Array, own: Own | None = None) -> Array:
        """Z of each channel after each row; ``recent`` begins three rows before the first.

        ``own``: of channels that lack readings; None where none does. Windows count readings.
        """
        own = own or self._whole
        left, count = WARM_UP_SCANS - self._scans, len(recent) - 3
        left = min(left if left > 0 else count, self._rows.most)
        if left < count:
            # A learned level applies from the next row on, in blocks as well as row by row.
            lacking, logs, missing = own
            parts = (
                (recent[: left + 3], (lacking, logs[:left], missing[:left])),
                (recent[left:], (lacking, logs[left:], missing[left:])),
            )
            return np.concatenate([self.step(*part) for part in parts])
        follow = self._follow if self._compiled else self._judged
        found = follow(recent, own, count)
        self._learn(count)
        return found

    def own(self, trains: Mapping[int, ReadingTrain], inside: Array) -> Own | None:
        """What ``step`` takes of channels that lack readings, if any; ``inside`` is its ``recent``.

        The rest of a motion in the noise grows with the third power of the time between readings:
        of that much is taken off what lies above nominal.
        """
        if not trains:
            self._sound = {}
            return None
        logs = np.full((len(inside) - 3, inside.shape[1]), math.nan)
        missing, lacking = np.zeros(logs.shape, dtype=bool), np.zeros(logs.shape[1], dtype=bool)
        kept: dict[int, Flags] = {}
        for channel, train in trains.items():
            lacking[channel], missing[:, channel] = True, True
            missing[train.places, channel] = False
            found, loudest = train_logs(train, self._resolution[channel]), self._loudest[channel]
            apart = np.maximum(longest_gaps(train) / self._every[channel], 1.0)
            most = math.exp(2.0 * (self._quietest[channel] - loudest))
            more = 0.5 * np.log(most + apart**6 * (1.0 - most))
            less = np.where(apart > 1.0, np.maximum(loudest, found - more), found)
            sound = ~np.isnan(inside[:, channel])
            row = np.append(self._sound.get(channel, sound[:3]), sound[3 + train.places])
            four = row[:-3] & row[1:-2] & row[2:-1] & row[3:]
            logs[train.places, channel] = np.where(four, np.minimum(found, less), math.nan)
            kept[channel] = row[-3:]
        self._sound = kept
        return lacking, logs, missing

    def _follow(self, recent: Array, own: Own, count: int) -> Array:
        """The same as one compiled loop."""
        found = np.empty((count, len(self._resolution)))
        backends.exact(*NOISE_LOOPS)(recent, own, self.memory, found)
        return found

    @property
    def memory(self) -> Memory:
        """The state, for ``noise_loops`` to go on with."""
        return self._rows.store, self._rows.end, self._state.flat

    def takes(self, count: int) -> bool:
        """Whether so many rows may come at once: what is learned applies from the next row on."""
        return self._scans >= WARM_UP_SCANS or self._scans + count <= WARM_UP_SCANS

    def taken(self, count: int) -> None:
        """Compiled loops have judged so many rows, none of which lacks a reading."""
        self._sound = {}
        self._learn(count)

    def _judged(self, recent: Array, own: Own, count: int) -> Array:
        """The same in numpy."""
        lacking, given, missing = own
        logs = noise_logs(recent, self._resolution)
        if lacking.any():
            logs[:, lacking] = given[:, lacking]
        logs = np.minimum(logs, self._most)
        valid = np.isfinite(logs)
        new = np.empty((count, 2 * logs.shape[1]), dtype=np.int64)
        new[:, : logs.shape[1]] = np.where(valid, np.rint(logs * 1e6), 0.0)
        new[:, logs.shape[1] :] = valid
        before = self._rows.last(self._rows.size).copy() if lacking.any() else new
        sums = new[:, None, :] - self._rows.push(new)
        held = self._state.table
        sums[0] += held["sums"]
        np.cumsum(sums, axis=0, out=sums)
        for channel in np.flatnonzero(lacking).tolist():
            pair = [channel, channel + logs.shape[1]]
            new[missing[:, channel], pair[0]] = new[missing[:, channel], pair[1]] = 0
            sums[:, :, pair] = self._of_readings(pair, before, new, missing[:, channel])
        held["sums"][:] = sums[-1]
        held["first"] += new.sum(axis=0)
        return self._z(sums[:, :, : logs.shape[1]], sums[:, :, logs.shape[1] :])

    def _of_readings(self, pair: list[int], before: Counts, new: Counts, missing: Flags) -> Counts:
        """Sums of a channel that lacks readings, shape (n, windows, 2): a window counts readings.

        ``before``: the rows up to these; ``pair``: its columns.
        """
        came = np.flatnonzero(~missing)
        train = np.concatenate((before[:, pair], new[came][:, pair]))
        self._rows.last(self._rows.size)[:, pair] = train[-self._rows.size :]
        leaving = train[np.arange(len(came))[:, None] + (self._rows.size - LENGTHS)]
        change = new[came][:, None, pair] - leaving
        before_them = self._state.table["sums"][None, :, pair]
        whole = np.concatenate((before_them, change)).cumsum(axis=0)
        sums: Counts = whole[np.cumsum(~missing)]
        return sums

    def _z(self, total: npt.NDArray[np.int64], samples: npt.NDArray[np.int64]) -> Array:
        """Statistic of each channel from the window farther from nominal, shape (n, channels)."""
        mean = 1e-6 * total / np.maximum(samples, 1)
        # Half of the window must have been measured.
        beyond = ((mean > self._ceiling) | (mean < self._floor)) & (2 * samples >= WINDOWS)
        found = np.zeros((len(mean), mean.shape[2]))
        if beyond.any():
            over = np.maximum(mean - self._ceiling, 0.0) + np.minimum(mean - self._floor, 0.0)
            for z in np.where(beyond, over / self._sigma, 0.0).transpose(1, 0, 2):
                found = np.where(np.abs(z) > np.abs(found), z, found)
        return found

    def _learn(self, count: int) -> None:
        """Learn the excess noise of this unit over nominal in its first seconds."""
        if self._scans >= WARM_UP_SCANS:
            return
        self._scans += count
        if self._scans >= WARM_UP_SCANS:
            total, samples = np.split(self._state.table["first"], 2)
            louder = np.where(samples, 1e-6 * total / np.maximum(samples, 1) - self._loudest, 0.0)
            self._ceiling = self._loudest + UNIT_LOG + np.clip(louder, 0.0, LARGEST_BASELINE)
            self._state.table["levels"][2] = self._ceiling
