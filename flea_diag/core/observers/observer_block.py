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

"""Input and output of the state observer for n scans.

The compiled loop (``track_loops.track_loops``) and the loop in Python fill the same rows, so that
all later steps exist once, on ``Innovations``.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from flea_diag.core.frozen import Frozen
from flea_diag.core.observers.driven_model import STATES
from flea_diag.core.observers.state_filter import Innovation
from flea_diag.core.residuals.driven_equations import DrivenChannels
from flea_diag.core.residuals.residual_rows import ResidualSet

Array = npt.NDArray[np.float64]
Flags = npt.NDArray[np.bool_]

ABSURD = 1.0e6
"""No channel of a test stand reaches this value in SI units: not a measurement."""
TOLD = 4
"""Numbers told of each heated store: prediction, residual, sigma and estimate."""


@dataclass(frozen=True)
class RowLayout(Frozen):
    """Where rows of the observer hold what: first the filter's innovation, then heated stores.

    ``motion`` and ``predicted`` are numbers of channels, ``warm`` the start of the stores in a raw
    row and ``raw`` its length; ``order`` makes of a raw row that of an ``Innovation``.
    """

    motion: int
    predicted: int
    warm: int
    raw: int
    order: npt.NDArray[np.int64]


@lru_cache(maxsize=8)
def row_layout(motion: int, heated: int) -> RowLayout:
    """For so many channels of the motion and heated stores."""
    warm = 3 * motion + len(STATES) + 2
    stores = warm + TOLD * np.arange(heated)
    order = np.concatenate(
        [
            *(np.concatenate([k * motion + np.arange(motion), stores + k]) for k in range(3)),
            3 * motion + np.arange(len(STATES)),
            stores + 3,
            [warm - 2, warm - 1],
        ]
    )
    order.setflags(write=False)
    return RowLayout(motion, motion + heated, warm, warm + TOLD * heated, order)


class ReadingColumns(NamedTuple):
    """Where a row of readings holds what the filter takes, -1 where the stand lacks a channel."""

    motion: tuple[int, ...]
    inputs: tuple[int, ...]
    command: int
    degc: tuple[int, ...]

    @classmethod
    def of(cls, rows: ResidualSet, by: DrivenChannels) -> ReadingColumns:
        """Of one stand."""
        motion, inputs, degc = (
            tuple(map(rows.channel, names)) for names in (by.readings, by.inputs, by.around)
        )
        return cls(motion, inputs, rows.channel(by.command), degc)


def innovated_places(rows: ResidualSet) -> tuple[int, ...]:
    """Places among what is predicted of the channels whose innovations are tested."""
    return tuple(rows.predicted.index(channel) for channel in rows.innovated)


def _taken(rows: Array, columns: tuple[int, ...]) -> Array:
    """These columns, NaN for one that is lacking."""
    found = rows.take(columns, axis=1)
    found[:, np.array(columns) < 0] = np.nan
    return found


class Scans(NamedTuple):
    """Readings of n scans as the filter takes them, NaN = not measured.

    ``u`` inputs, shape (n, 2); ``y`` measurements of the motion; ``held`` those of them that count
    while frozen; ``degc`` of heated stores and what is around them; each of shape (n, channels).
    """

    u: Array
    y: Array
    held: Array
    degc: Array

    @classmethod
    def read(
        cls,
        rows: Array,
        columns: ReadingColumns,
        absent: Flags,
        command: tuple[float, float],
        driving: Flags,
    ) -> Scans:
        """From rows of readings; without a voltage ``command`` (offset, gain) gives it."""
        rows = np.where(np.abs(rows) < ABSURD, rows, np.nan)
        y, u = _taken(rows, columns.motion), _taken(rows, columns.inputs)
        y[:, absent] = np.nan
        lost = np.isnan(u[:, 0])
        if lost.any() and columns.command >= 0:
            u[lost, 0] = command[0] + command[1] * rows[lost, columns.command]
        return cls(u, y, np.where(driving, y, np.nan), _taken(rows, columns.degc))


class Innovations(NamedTuple):
    """``Innovation`` of n scans, a row of ``table`` each, for all ``channels`` predicted."""

    channels: int
    table: Array
    measured: npt.NDArray[np.int64]
    diverged: Flags

    @classmethod
    def empty(cls, layout: RowLayout, count: int) -> Innovations:
        """Uninitialised, of ``count`` scans."""
        table, lost = np.empty((count, len(layout.order))), np.empty(count, dtype=bool)
        return cls(layout.predicted, table, np.empty(count, dtype=np.int64), lost)

    def part(self, first: int) -> Innovations:
        """From one scan on."""
        if not first:
            return self
        rest = slice(first, None)
        return Innovations(
            self.channels, self.table[rest], self.measured[rest], self.diverged[rest]
        )

    @classmethod
    def joined(
        cls, layout: RowLayout, raw: Array, measured: npt.NDArray[np.int64], diverged: Flags
    ) -> Innovations:
        """Motion and the independent stores in one, from raw rows; ``measured`` of motion."""
        table, p, total = raw.take(layout.order, axis=1), layout.motion, layout.predicted
        warmth = table[:, total + p : 2 * total] / table[:, 2 * total + p : 3 * total]
        seen = warmth == warmth
        warmth[~seen] = 0.0
        table[:, -2] += (warmth * warmth).sum(axis=1)
        return cls(total, table, measured + seen.sum(axis=1), diverged)

    def scan(self, number: int) -> Innovation:
        """Innovation of one scan."""
        measured, diverged = self.measured.item(number), self.diverged.item(number)
        return Innovation(self.table[number], self.channels, measured, diverged)

    @property
    def predictions(self) -> Array:
        """Shape (n, channels)."""
        return self.table[:, : self.channels]

    @property
    def residuals(self) -> Array:
        """Shape (n, channels), NaN where nothing was measured."""
        return self.table[:, self.channels : 2 * self.channels]

    @property
    def sigmas(self) -> Array:
        """Shape (n, channels), 0 where nothing was measured."""
        return self.table[:, 2 * self.channels : 3 * self.channels]

    @property
    def means(self) -> Array:
        """Estimated states after each scan: of motion, then of heated stores."""
        return self.table[:, 3 * self.channels : -2]

    @property
    def nis(self) -> Array:
        """Normalised innovation squared, shape (n,)."""
        return self.table[:, -2]

    @property
    def ess(self) -> Array:
        """Effective sample size before resampling, shape (n,); inf without particles."""
        return self.table[:, -1]
