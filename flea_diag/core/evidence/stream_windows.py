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

"""Windows of a stream of scans: what ``run_windows`` makes of a whole recording, as they come."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from flea_diag.core import backend as backends
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


@dataclass(frozen=True, eq=False)
class LawWindow(Frozen):
    """Means over one window, or over each of several, which are then the first of all dimensions.

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
    stands: bool | np.bool_ | Flags

    def part(self, which: int | slice) -> LawWindow:
        """One of several windows, or some of them."""
        assert isinstance(self.stands, np.ndarray), "one window has no parts"
        return LawWindow(
            self.values[which], self.signals[which], self.read[which], self.motion[which],
            self.stands[which],
        )  # fmt: skip

    @staticmethod
    def joined(pieces: Sequence[LawWindow]) -> LawWindow:
        """Pieces of several windows each that follow each other."""
        every = ((p.values, p.signals, p.read, p.motion, p.stands) for p in pieces)
        return LawWindow(*map(np.concatenate, zip(*every, strict=True)))


@dataclass(frozen=True, eq=False)
class LawScans(Frozen):
    """What windows are made of.

    Attributes
    ----------
    values
        Residuals, shape (n, relations).
    table
        Of regressors, shape (n, names).
    stands
        Scans of a standstill against a push, shape (n,).
    """

    values: Array
    table: Array
    stands: Flags

    def __len__(self) -> int:
        return len(self.stands)

    def part(self, which: slice) -> LawScans:
        """Some of these scans."""
        return LawScans(self.values[which], self.table[which], self.stands[which])

    @staticmethod
    def joined(pieces: Sequence[LawScans]) -> LawScans:
        """Pieces that follow each other."""
        if len(pieces) == 1:
            return pieces[0]
        every = ((p.values, p.table, p.stands) for p in pieces)
        return LawScans(*map(np.concatenate, zip(*every, strict=True)))


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
    side
        Name of the smooth sign of the current among the signals; empty: there is none.
    """

    def __init__(
        self, relations: Sequence[str], signals: Sequence[str], names: Sequence[str],
        motion: tuple[str, str, str, str], acting: Flags, travel: tuple[float, ...],
        period_s: float, scans: int, side: str = "",
    ) -> None:  # fmt: skip
        place = {name: k for k, name in enumerate(names)}
        formed = [name for name in signals if name not in FORMED]
        told = [[place.get(own_name(r, s), place[s]) for s in formed] for r in relations]
        # As they are read, and as each relation says. Mostly all relations take the same columns,
        # which are then formed once.
        every = np.array([[place[s] for s in formed], *told], dtype=int)
        self._formed_of, which = np.unique(every, axis=0, return_inverse=True)
        self._rows = which.reshape(-1)
        places = (formed.index(name) for name in motion)
        self._current, self._load, self._way, self._speed = places
        self._side = formed.index(side) if side else None
        self._moves = WindowMotion()
        self._place, self._travel = place[PLACE], travel
        self._acting = acting[:, : len(formed)]
        self._period_s, self._scans = period_s, scans
        self._compiled = backends.chosen("auto") == "numba"
        self._before: Array | None = None
        self._heat = 0.0
        self._begun: list[LawScans] = []
        """Of a window that is not whole yet."""

    def add(self, scans: LawScans) -> Iterator[tuple[int, LawWindow]]:
        """Take n scans.

        Yields
        ------
        Number of the scan of this block that completes a window, and the window.
        """
        first, windows = self.together(scans)
        for k in range(len(windows.values)):
            yield first + k * self._scans, windows.part(k)

    def together(self, scans: LawScans) -> tuple[int, LawWindow]:
        """The same for all of them: number of the scan that completes the first, and windows."""
        begun = sum(map(len, self._begun))
        whole = (begun + len(scans)) // self._scans * self._scans
        self._begun.append(scans)
        every = LawScans.joined(self._begun) if whole else scans.part(slice(0))
        if whole:
            self._begun = [every.part(slice(whole, None))]
        return self._scans - begun - 1, self._means(every.part(slice(whole)))

    def pass_over(self, scans: LawScans) -> None:
        """Take whole windows that are not asked for: what later ones have of them is kept."""
        assert not any(map(len, self._begun)), "a window has begun"
        current, _ = self._currents(scans.table[:, self._formed_of[:, self._current]])
        self._warmed(current)
        speed = scans.table[:, self._formed_of[self._rows[0], self._speed]]
        self._moves.steps(
            *(np.zeros_like(speed).reshape(-1, self._scans),) * 2, speed.reshape(-1, self._scans)
        )

    def _currents(self, read: Array) -> tuple[Array, Array]:
        """Current of each row, shape (n, rows), and its rate."""
        current = zeroed(read)
        before = current[:1] if self._before is None else self._before
        self._before = current[-1:] if len(current) else self._before
        return current, np.diff(current, axis=0, prepend=before) / self._period_s

    def _warmed(self, current: Array) -> Array:
        """Losses up to each scan."""
        heat = losses(current[:, self._rows[0]], self._heat, self._period_s, self._compiled)
        self._heat = float(heat[-1]) if len(heat) else self._heat
        return heat

    def _formed(self, table: Array) -> Array:
        """Signals of each row in each scan, shape (n, rows, signals)."""
        read = table[:, self._formed_of]
        formed = zeroed(read)
        current, rate = self._currents(read[..., self._current])
        load, way = formed[..., self._load], formed[..., self._way]
        place = np.broadcast_to(along(table[:, self._place], self._travel)[:, None], way.shape)
        side = None if self._side is None else formed[..., self._side]
        behind = left_out(current, rate, self._warmed(current)[:, None], load, way, place, side)
        return np.concatenate((formed, behind), axis=-1)

    def _means(self, scans: LawScans) -> LawWindow:
        """Means over windows that are whole."""
        told, form = self._rows[1:], (-1, self._scans)
        values = scans.values
        missing = np.isnan(scans.table[:, self._formed_of])
        if missing.any():
            values = np.where((missing[:, told] & self._acting).any(axis=-1), np.nan, values)
        values = values.reshape(*form, len(told))
        formed = self._formed(scans.table)
        formed = formed.reshape(*form, *formed.shape[1:])
        known = np.isfinite(values)
        found = known.sum(axis=1)
        share = known / np.maximum(found, 1)[:, None]
        means = (zeroed(values) * share).sum(axis=1)
        means[2 * found <= self._scans] = np.nan
        read = formed[:, :, self._rows[0]]
        motion = self._moves.steps(*(read[..., k] for k in (self._way, self._load, self._speed)))
        stood = 2 * scans.stands.reshape(form).sum(axis=1) > self._scans
        shares = np.ascontiguousarray(share.transpose(0, 2, 1))
        by_row = [shares @ np.ascontiguousarray(formed[:, :, k]) for k in range(formed.shape[2])]
        signals = np.stack([by_row[k][:, r] for r, k in enumerate(told)], axis=1)
        return LawWindow(means, signals, by_row[self._rows[0]], motion, stood)
