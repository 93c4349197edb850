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

"""Where an actuator rests, by its positions and speed: there some sensors rightly stand still."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from flea_diag.core.flag_runs import flag_runs
from flea_diag.core.sensors.sensor_set import SensorSet

Array = npt.NDArray[np.float64]
Flags = npt.NDArray[np.bool_]

REST_S = 0.03
"""Time within which a position is seen to move: shorter than a drop-out."""
STUCK_S = 0.5
"""A reading held for this long is stuck; held for less it is a drop-out. A rest that shows
what a sensor does in it lasts for as long: where a motion turns, it rests for a moment."""


def at_rest(positions: Array, rest: Array, scans: int) -> Flags:
    """Where no position has moved in so many scans, shape (n, positions) gives (n - scans,).

    ``rest`` are their ``SensorSet.positions``. Without a position nothing says so.
    """
    moved = moves(positions, rest, scans)
    rests = np.full(len(moved), bool(positions.shape[1]))
    rests &= ~moved.any(axis=1)
    return rests


def moves(positions: Array, rest: Array, scans: int) -> Flags:
    """The same position by position: where it has moved, shape (n - scans, positions)."""
    with np.errstate(invalid="ignore"):
        return np.asarray(np.abs(positions[scans:] - positions[:-scans]) > rest)


def long_runs(flags: Flags, least: int) -> Flags:
    """Where the flag is set for at least so many in a row, shape (n,) as ``flags``."""
    found = np.zeros(len(flags), dtype=bool)
    for first, after in flag_runs(flags).tolist():
        found[first:after] = after - first >= least
    return found


class RestWatch:
    """At which scans held and quiet readings of a channel are not judged.

    Those of the encoder's speed while the positions rest, and those of a channel whose rest the
    calibration has not seen, while all other sensors of the motion say that it rests: positions
    stay, and the speed has read zero.

    Parameters
    ----------
    names : the channels, columns of the rows
    unseen : those whose rest the calibration has not seen
    sensors : which of them are positions and speed
    scans : within which a position is seen to move
    """

    def __init__(
        self, names: Sequence[str], unseen: Sequence[str], sensors: SensorSet, scans: int
    ) -> None:
        rests = {name: rest for name, rest in sensors.positions.items() if name in names}
        self._positions = [names.index(name) for name in rests]
        self._rest, self.scans = np.array(list(rests.values())), scans
        self._speed = [names.index(name) for name in names if name == sensors.speed]
        self._columns = np.array(self._positions + self._speed, dtype=int)
        self.unseen = [names.index(name) for name in unseen]
        """Columns of the channels whose rest is not known."""
        self.interrupt()

    def interrupt(self) -> None:
        """A gap in the stream."""
        self._known: Array | None = np.full((self.scans, len(self._columns)), np.nan)
        self._whole = self._known
        self._before = np.zeros((3, len(self.unseen)), dtype=bool)

    def step(self, recent: Array, count: int, is_whole: bool = False) -> None:
        """Take the last ``count`` rows, shape (n, channels); a missing reading stays what it was.

        ``is_whole``: none is missing, and ``recent`` holds as many ``scans`` before.
        """
        if is_whole:  # formed when it is asked for
            self._whole, self._known = recent[-count - self.scans :], None
            return
        last = self._motion[-self.scans :]
        motion = np.concatenate((last, recent[-count:].take(self._columns, axis=1)))
        missing = np.isnan(motion)
        if missing.any():
            read = np.where(missing, 0, np.arange(len(motion))[:, None])
            motion = np.take_along_axis(motion, np.maximum.accumulate(read, axis=0), axis=0)
        self._known = motion

    @property
    def _motion(self) -> Array:
        """Positions and speed of the last rows, and of ``scans`` before them."""
        if self._known is None:
            self._known = self._whole.take(self._columns, axis=1)
        return self._known

    def of(self, column: int) -> Flags | None:
        """At which of the rows a held reading of a channel is not judged; None: at none."""
        if column in self._speed:
            positions = self._motion[:, : len(self._positions)]
            return at_rest(positions, self._rest, self.scans)
        return self._still(column) if column in self.unseen else None

    def leave_out(self, inside: Array) -> None:
        """Set readings at a rest that is not known to NaN, from three rows before the last ones."""
        if self.unseen:
            still = np.stack([self._still(column) for column in self.unseen], axis=1)
            still = np.concatenate((self._before, still))
            for at, column in enumerate(self.unseen):
                inside[still[:, at], column] = np.nan
            self._before = still[-3:]

    def _still(self, column: int) -> Flags:
        """Where all sensors of the motion but this one rest; nowhere if there is no other."""
        scans, count = self.scans, len(self._positions)
        moved = moves(self._motion[:, :count], self._rest, scans)
        others = [~moved[:, k] for k, other in enumerate(self._positions) if other != column]
        if self._speed and column not in self._speed:
            zero = self._motion[:, count] == 0.0
            ends = [slice(k, k + len(moved)) for k in range(scans + 1)]
            others.append(np.any([zero[end] for end in ends], axis=0))
        return np.all(others, axis=0) if others else np.zeros(len(moved), dtype=bool)
