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

"""Windows of a stream of scans: what ``run_windows`` makes of a whole recording, one by one."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from flea_diag.core.frozen import Frozen
from flea_diag.core.run_law.run_windows import (
    FORMED,
    PLACE,
    WindowMotion,
    along,
    left_out,
    losses,
    own_name,
    zeroed,
)

Array = npt.NDArray[np.float64]
Flags = npt.NDArray[np.bool_]
Places = npt.NDArray[np.intp]


@dataclass(frozen=True, eq=False)
class LawWindow(Frozen):
    """Means over one window.

    Attributes
    ----------
    values
        Residuals, shape (relations,), NaN where most scans of the window have none.
    signals
        As each relation itself says that they should be, over the scans in which its residual has
        a value, shape (relations, signals): what recordings differ by acts by these.
    read
        The same as they are read: what a sensor's error does is a share of its reading.
    motion
        What the noise grows with, shape (``MOTIONS``,).
    stands
        Whether it stands against a push that no friction of a healthy machine withstands.
    """

    values: Array
    signals: Array
    read: Array
    motion: Array
    stands: bool


class LawWindowMeans:
    """Windows of so many scans, whatever the blocks in which these come.

    Parameters
    ----------
    relations, signals
        Of the law; the last ones, ``FORMED``, are made here of current, load, direction and
        place.
    names
        Columns of the table of regressors; a relation takes those of its own where it has any.
    motion
        Names of current, load, direction and speed among the signals.
    acting
        By which signals anything acts in a relation, shape (relations, signals): it says nothing
        where one of them is missing.
    travel
        Ends of the healthy one; empty: not known.
    """

    def __init__(
        self, relations: Sequence[str], signals: Sequence[str], names: Sequence[str],
        motion: tuple[str, str, str, str], acting: Flags, travel: tuple[float, ...],
        period_s: float, scans: int,
    ) -> None:  # fmt: skip
        place = {name: k for k, name in enumerate(names)}
        formed = [name for name in signals if name not in FORMED]
        self._told = np.array(
            [[place.get(own_name(r, s), place[s]) for s in formed] for r in relations], dtype=int
        )
        read = np.array([place[s] for s in formed], dtype=int)
        # Mostly all relations take the same columns, which are then formed once.
        every = np.vstack((read, self._told))
        self._formed_of, which = np.unique(every, axis=0, return_inverse=True)
        self._rows = which.reshape(-1)
        places = (formed.index(name) for name in motion)
        self._current, self._load, self._way, self._speed = places
        self._moves = WindowMotion()
        self._place, self._travel = place[PLACE], travel
        self._acting = acting[:, : len(formed)]
        self._period_s, self._scans = period_s, scans
        self._before: Array | None = None
        self._heat = 0.0
        self._values = np.empty((0, len(relations)))
        self._signals = np.empty((0, 1 + len(relations), len(signals)))
        self._stands = np.empty(0, dtype=bool)

    def add(self, values: Array, table: Array, stands: Flags) -> Iterator[tuple[int, LawWindow]]:
        """Take n scans: residuals, shape (n, relations), and the table, shape (n, names).

        ``stands``: those of a standstill against a push, shape (n,).

        Yields
        ------
        Number of the scan of this block that completes a window, and the window.
        """
        begun = len(self._values)
        missing = (np.isnan(table[:, self._told]) & self._acting).any(axis=-1)
        values = np.where(missing, np.nan, values)
        values = np.concatenate((self._values, values))
        signals = np.concatenate((self._signals, self._formed(table)))
        stands = np.concatenate((self._stands, stands))
        whole = len(values) // self._scans * self._scans
        # Kept before any window is handed out: whoever takes them may stop at one.
        self._values, self._signals = values[whole:], signals[whole:]
        self._stands = stands[whole:]
        for first in range(0, whole, self._scans):
            window = slice(first, first + self._scans)
            mean = self._mean(values[window], signals[window], stands[window])
            yield window.stop - begun - 1, mean

    def _formed(self, table: Array) -> Array:
        """Signals as read and of each relation in each scan, shape (n, 1 + relations, signals)."""
        formed = zeroed(table[:, self._formed_of])
        current = formed[..., self._current]
        before = current[:1] if self._before is None else self._before
        self._before = current[-1:]
        rate = np.diff(current, axis=0, prepend=before) / self._period_s
        load, way = formed[..., self._load], formed[..., self._way]
        place = np.broadcast_to(along(table[:, self._place], self._travel)[:, None], way.shape)
        heat = losses(current[:, self._rows[0]], self._heat, self._period_s)
        self._heat = float(heat[-1]) if len(heat) else self._heat
        behind = left_out(current, rate, heat[:, None], load, way, place)
        return np.concatenate((formed, behind), axis=-1)[:, self._rows]

    def _mean(self, values: Array, signals: Array, stands: Flags) -> LawWindow:
        known = np.isfinite(values)
        found = known.sum(axis=0)
        share = known / np.maximum(found, 1)
        means = (zeroed(values) * share).sum(axis=0)
        means[2 * found <= len(values)] = np.nan
        motion = self._moves.step(*(signals[:, 0, k] for k in (self._way, self._load, self._speed)))
        told = np.einsum("nr,nrs->rs", share, signals[:, 1:])
        stood = 2 * int(stands.sum()) > len(values)
        return LawWindow(means, told, share.T @ signals[:, 0], motion, stood)
