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

"""In which modes a machine is, scan by scan, and which residuals have no value in them.

A smoothed reading rests on a kernel of scans, so what holds in one scan counts until the kernel
and the time that the mode settles in have passed. Where its channel is not read, a mode is
unknown: what depends on it has no value.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from flea_diag.core.frozen import Frozen

Array = npt.NDArray[np.float64]
Flags = npt.NDArray[np.bool_]
States = npt.NDArray[np.int8]

Voids = list[tuple[tuple[int, ...], Flags]]
"""Columns of residuals, and in which scans they have no value."""

OUT, IN, UNKNOWN = 0, 1, 2
"""States of a mode."""
HELD = "held still without current"
"""Mode that no channel tells: it stands under a load that would move it, and no motor holds it."""


@dataclass(frozen=True, slots=True)
class ModeRow(Frozen):
    """One mode on one stand: the column of its channel, and what it does to the residuals.

    Of a mode that no channel tells, the column is -1.

    ``voids`` are the columns without a value in it, ``only`` those without one elsewhere. A machine
    that ``stands`` is held; the state observer does not follow a machine that is not ``followed``.
    """

    name: str
    channel: int
    above: float
    below: float
    settles_s: float
    voids: tuple[int, ...]
    only: tuple[int, ...]
    stands: bool
    followed: bool


class MachineModes:
    """Modes of one stream of scans."""

    def __init__(self, rows: Sequence[ModeRow], period_s: float, kernel_length: int) -> None:
        self._rows = tuple(rows)
        self._lasts = [kernel_length + math.ceil(row.settles_s / period_s) for row in rows]
        self._since = [[most, most] for most in self._lasts]

    def step(self, readings: Array, held: Flags | None = None) -> tuple[States, Voids]:
        """States of n scans, shape (n, modes), and what has no value in them.

        ``readings`` has shape (n, channels), ``held``, shape (n,), is where nothing but a lock can
        hold the machine. A mode lasts until nothing of it counts any more.
        """
        held = np.zeros(len(readings), dtype=bool) if held is None else held
        states = np.zeros((len(readings), len(self._rows)), dtype=np.int8)
        voids: Voids = []
        for k, row in enumerate(self._rows):
            told = row.channel >= 0
            now = _state(readings[:, row.channel], row) if told else held.astype(np.int8)
            inside, outside = (self._lasting(k, side, now != side) for side in (OUT, IN))
            states[:, k] = np.where(now == OUT, inside, now)
            columns = ((row.voids, inside), (row.only, outside))
            voids += [(named, flags) for named, flags in columns if named and flags.any()]
        return states, voids

    def _lasting(self, mode: int, side: int, flags: Flags) -> Flags:
        """Which scans are less than a kernel after one that is flagged."""
        scans, most = np.arange(len(flags)), self._lasts[mode]
        last = np.maximum.accumulate(np.where(flags, scans, -1 - self._since[mode][side]))
        passed = scans - last
        self._since[mode][side] = int(min(passed[-1], most))
        found: Flags = passed < most
        return found

    def interrupt(self) -> None:
        """The next scans follow a gap: smoothing begins anew."""
        self._since = [[most, most] for most in self._lasts]


def never_seen(rows: Sequence[ModeRow], recordings: Sequence[Array]) -> list[ModeRow]:
    """Modes that none of these recordings shows, each of shape (scans, channels)."""
    told = [row for row in rows if row.channel >= 0]
    return [
        row
        for row in told
        if not any((_state(each[:, row.channel], row) == IN).any() for each in recordings)
    ]


def never_seen_words(row: ModeRow, channel: str) -> str:
    """That a mode is never seen, and where its channel would have to be."""
    limits = ((row.above, "above"), (row.below, "below"))
    between = " and ".join(f"{word} {limit:g}" for limit, word in limits if limit == limit)
    return f"mode {row.name} is never seen: {channel} is nowhere {between}"


def _state(values: Array, row: ModeRow) -> States:
    """State of a mode by the readings of its channel alone, shape (n,)."""
    inside = ~((values <= row.above) | (values >= row.below))
    return np.where(np.isnan(values), UNKNOWN, inside).astype(np.int8)
