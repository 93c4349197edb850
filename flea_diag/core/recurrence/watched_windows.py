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

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from flea_diag.core.evidence.hypotheses import StreamHypotheses
from flea_diag.core.evidence.stream_windows import LawScans, LawWindow, LawWindowMeans
from flea_diag.core.recurrence.presence import Presence, presence
from flea_diag.core.recurrence.stream_part import StreamPart
from flea_diag.core.recurrence.stream_rows import WindowRows

Array = npt.NDArray[np.float64]
Flags = npt.NDArray[np.bool_]


@dataclass(frozen=True)
class WatchedWindow:
    """One window.

    Attributes
    ----------
    end_ns
        Stamp of its last scan.
    row
        Of the relations; it alone.
    jump
        By how much each reading has jumped at most.
    place
        Along the stroke, NaN where nothing reads it.
    scans
        That it is made of.
    """

    end_ns: int
    row: WindowRows
    jump: Array
    place: float
    scans: LawScans


class WatchedWindows:
    """Windows of a stream since something was first far out, at most so many.

    What faults would have added to them is formed when it is asked for, of all new ones at once.

    Parameters
    ----------
    fast
        Relations that are looked at, shape (relations,).
    load
        Place of the load among the signals.
    """

    def __init__(self, hypotheses: StreamHypotheses, fast: Flags, load: int, most: int) -> None:
        self._h, self._fast, self._load, self._most = hypotheses, fast, load, most
        self._windows: list[WatchedWindow] = []
        self._formed = 0
        self._errors, self._faults, self._units, self._ways, self._jumps = (np.empty(0),) * 5

    def __len__(self) -> int:
        return len(self._windows)

    def add(self, window: WatchedWindow) -> None:
        """Take the next window."""
        self._windows.append(window)

    def end_ns(self, number: int) -> int:
        """Stamp of the last scan of a window."""
        return self._windows[number].end_ns

    def places(self, count: int) -> Array:
        """Of the first windows, shape (count,)."""
        return np.array([window.place for window in self._windows[:count]])

    def moments(self, count: int, moments: LawWindowMeans) -> StreamPart:
        """The last so many windows, by ``moments`` of them."""
        windows = self._windows[-count:]
        rows, within = _parted(windows, moments)
        told = [each[:, self._fast] for each in rows.all_within(self._h, within)]
        jumps = np.array([window.jump for window in windows])
        each = len(told[0]) // len(windows)
        errors, faults, units = told
        faults = faults.reshape(*faults.shape[:2], *self._h.signatures.shape)
        return StreamPart(errors, faults, units, self._ways_of(within), jumps.repeat(each, axis=0))

    def _ways_of(self, window: LawWindow) -> Array:
        """Directions of motion and of the load, shape (n, signals)."""
        load = np.sign(np.median(window.read[..., self._load], axis=-1))
        return np.column_stack((self._h.friction.way(window), load))

    def presence(
        self, count: int, moments: LawWindowMeans, model: int, size: Array, moment_s: float
    ) -> Presence:
        """Of a fault of this size in the first windows, by ``moments`` of them."""
        rows, within = _parted(self._windows[:count], moments)
        errors, effect = rows.within(self._h, within, model, size)
        return presence(errors[:, self._fast], effect[:, self._fast], moment_s)

    def drop(self, count: int) -> None:
        """Forget the oldest."""
        self._form()
        del self._windows[:count]
        for rows in (self._errors, self._faults, self._units, self._ways, self._jumps):
            rows[: len(self)] = rows[count : count + len(self)].copy()
        self._formed = len(self)

    def part(self) -> StreamPart:
        """All of them."""
        self._form()
        count, shape = len(self), self._h.signatures.shape
        faults = self._faults[:count].reshape(count, -1, *shape)
        units, ways, jumps = self._units[:count], self._ways[:count], self._jumps[:count]
        return StreamPart(self._errors[:count], faults, units, ways, jumps)

    def _form(self) -> None:
        """What is new, behind what has been formed."""
        if self._formed == len(self):
            return
        fresh = self._windows[self._formed :]
        rows = WindowRows.joined([window.row for window in fresh])
        ways = self._ways_of(rows.window)
        new = slice(self._formed, len(self))
        told = (each[:, self._fast] for each in (rows.errors, *rows.added(self._h)))
        every = *told, ways, np.array([window.jump for window in fresh])
        if not self._formed:
            shapes = ((self._most, *each.shape[1:]) for each in every)
            self._errors, self._faults, self._units, self._ways, self._jumps = map(np.empty, shapes)
        kept = self._errors, self._faults, self._units, self._ways, self._jumps
        for rows_kept, made in zip(kept, every, strict=True):
            rows_kept[new] = made
        self._formed = len(self)


def _parted(
    windows: Sequence[WatchedWindow], moments: LawWindowMeans
) -> tuple[WindowRows, LawWindow]:
    """Rows of windows that follow each other, and the moments in them."""
    _, within = moments.together(LawScans.joined([window.scans for window in windows]))
    return WindowRows.joined([window.row for window in windows]), within
