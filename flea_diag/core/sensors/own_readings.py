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

"""Readings of a channel that does not come with every scan: each with the scan that brought it.

A scan without a reading says nothing of a sensor. Where readings are missing, tests of a sensor
count those that came, and what may change between two of them grows with the time between them.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from flea_diag.core.sensors.position_step import SPAN, step_of

Array = npt.NDArray[np.float64]
Counts = npt.NDArray[np.int64]
Flags = npt.NDArray[np.bool_]

KEPT = 2 * SPAN - 1
"""Readings that are kept for the next ones: those that a step takes with it."""


@dataclass(frozen=True, slots=True)
class ReadingTrain:
    """Readings in the order in which they came: some from before a block, then those in it.

    ``values``: shape (before + new, channels). ``scans``: that of each, in scans after the first of
    the block, negative before. ``new``: how many are in it.
    """

    values: Array
    scans: Counts
    new: int

    @property
    def places(self) -> Counts:
        """Scans of the block with a reading, shape (new,)."""
        return self.scans[len(self.scans) - self.new :]

    def count(self, scans: int) -> Counts:
        """How many are known after each scan of the block, shape (scans,)."""
        came = np.zeros(scans, dtype=np.int64)
        came[self.places] = 1
        counts: Counts = len(self.scans) - self.new + np.cumsum(came)
        return counts

    def last(self, before: int) -> tuple[Array, Counts]:
        """Values and scans of the new readings and of as many before, NaN where there are none."""
        lack = max(before + self.new - len(self.scans), 0)
        at = len(self.scans) - self.new - before + lack
        none = np.full((lack, self.values.shape[1]), math.nan)
        early = np.arange(-lack, 0) + (self.scans[0] if len(self.scans) else 0)
        return np.concatenate((none, self.values[at:])), np.append(early, self.scans[at:])


class OwnReadings:
    """Readings of groups of channels, of those groups that lack some.

    ``groups`` are columns; of a group only scans with all of its readings count.
    """

    def __init__(self, groups: Sequence[tuple[int, ...]]) -> None:
        self._groups = groups
        self._kept: dict[tuple[int, ...], tuple[Array, Counts]] = {}

    def interrupt(self) -> None:
        """A gap in the stream: what came before is forgotten."""
        self._kept = {}

    def step(
        self, scan: int, recent: Array, count: int, lacks: bool = True
    ) -> dict[tuple[int, ...], ReadingTrain]:
        """Trains of the last ``count`` rows of ``recent``, which begins ``KEPT`` rows earlier.

        ``scan`` is the number of the first of them; not ``lacks``: no reading is missing.
        """
        if not lacks:
            self._kept = {}
            return {}
        missing = np.isnan(recent)
        lacking = np.asarray(missing.any(axis=0))
        found = {}
        if lacking.any():
            for group in self._groups:
                if lacking[list(group)].any():
                    found[group] = self._train(group, scan, recent, missing, count)
        self._kept = {
            group: (train.values[-KEPT:], train.scans[-KEPT:] + scan)
            for group, train in found.items()
        }
        return found

    def _train(
        self, group: tuple[int, ...], scan: int, recent: Array, missing: Flags, count: int
    ) -> ReadingTrain:
        read = np.flatnonzero(~missing[:, group].any(axis=1))
        scans = read - (len(recent) - count)
        new = int(np.count_nonzero(scans >= 0))
        if group not in self._kept:
            return ReadingTrain(recent[read][:, group], scans, new)
        values, kept = self._kept[group]
        came = read[len(read) - new :]
        return ReadingTrain(
            np.concatenate((values, recent[came][:, group])),
            np.append(kept - scan, scans[len(scans) - new :]),
            new,
        )


def unusual(train: ReadingTrain, reach: float) -> Flags:
    """Which new readings leap or repeat the one before, shape (new,)."""
    values, scans = train.last(1)
    change = np.diff(values[:, 0])
    return np.asarray((np.abs(change) > reach * np.diff(scans)) | (change == 0.0))


def train_logs(train: ReadingTrain, resolution: float) -> Array:
    """Logarithm of the noise of each new reading, as ``sensor_limits.noise_logs``, shape (new,).

    The third divided difference, scaled to unit gain for white noise.
    """
    values, scans = train.last(3)
    x = values[:, 0]
    third = x[3:] - 3.0 * x[2:-1] + 3.0 * x[1:-2] - x[:-3]
    even = np.diff(scans, 2)
    plain = (even[: train.new] == 0) & (even[1 : train.new + 1] == 0)
    noise = np.abs(third) / math.sqrt(20.0)
    if not plain.all():
        noise = np.where(plain, noise, _apart(x, scans, train.new))
    logs: Array = np.log(np.maximum(noise, resolution))
    return logs


def _apart(x: Array, scans: Counts, new: int) -> Array:
    """That of readings that are not as far from each other, shape (new,)."""
    ends = [slice(k, k + new) for k in range(4)]
    at = [scans[end].astype(float) for end in ends]
    weights = [
        1.0 / math.prod((at[k] - at[j] for j in range(4) if j != k), start=np.ones(new))
        for k in range(4)
    ]
    size = np.sqrt(sum(weight * weight for weight in weights))
    return np.asarray(np.abs(sum(w * x[e] for w, e in zip(weights, ends, strict=True))) / size)


def longest_gaps(train: ReadingTrain) -> Counts:
    """The longest time between two of the four readings of each noise, in scans, shape (new,)."""
    gaps = np.diff(train.last(3)[1])
    return np.maximum(np.maximum(gaps[: train.new], gaps[1:-1]), gaps[2:])


def train_steps(train: ReadingTrain) -> Array:
    """Step in the middle of the 2 SPAN readings up to each new one, shape (new, channels).

    As ``position_step.position_steps``, with the readings put on even times by the median speed,
    which no step moves, and over the longest time in scans between two of them: so much of a
    motion may look like a step. NaN where too few have come.
    """
    values, scans = train.last(KEPT)
    found = np.full((train.new, values.shape[1]), math.nan)
    for k in range(train.new):
        at = scans[k : k + 2 * SPAN].astype(float)
        gaps = np.diff(at)
        late = at - at[SPAN - 1] - (at[-1] - at[0]) / KEPT * (np.arange(2 * SPAN) - (SPAN - 1.0))
        for c in range(values.shape[1]):
            x = values[k : k + 2 * SPAN, c]
            if gaps.max() > 1.0:
                x = x - np.median(np.diff(x) / gaps) * late
            found[k, c] = step_of(x.tolist(), min, max) / gaps.max()
    return found
