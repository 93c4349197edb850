"""Relations held against themselves: how the level of a residual changes within a run.

What healthy units differ by, a zero that nothing corroborates or a resistance that nobody
measured, stays what it is throughout a run. So the mean of the last w samples less the mean
of those before them knows nothing of it, and what is left to be told from a fault is a
fraction of what the calibration must allow any unit:

    d = mean(last w) - mean(up to REFERENCE before them),   |d| > k sigma   ->  symbol

A step or a drift of a sensor shows, wherever the level of its relation was; what was there
from the start does not, and is left to the tests against the calibration (``detection``). From
a detection on, the earlier level is frozen.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, fields
from typing import Any

import numpy as np
import numpy.typing as npt

from flea_diag.core import backend as backends
from flea_diag.core.frozen import Frozen
from flea_diag.core.shift_loops import shift_loops

Array = npt.NDArray[np.float64]
Flags = npt.NDArray[np.bool_]
Counts = npt.NDArray[np.int64]

SHIFT_WINDOWS = (200, 400)
REFERENCE, LEAST = 2000, 300
"""Most and fewest samples that an earlier level is the mean of."""
LEAST_ALWAYS = 600
"""Fewest of a relation that also counts at rest: strokes and rests in turn make its level."""
_KEPT = REFERENCE + max(SHIFT_WINDOWS) + 1
_ROOM = 1000


@dataclass(frozen=True, slots=True)
class ShiftLimit(Frozen):
    """Scatter of the shift of one residual over ``window`` samples, and its limit in sigmas."""

    name: str
    window: int
    sigma: float
    k: float

    @classmethod
    def from_mapping(cls, value: Any) -> ShiftLimit:
        """Limit from its plain mapping.

        Raises
        ------
        ValueError
            An entry that is missing, unknown, of the wrong kind or out of its range.
        """
        names = [entry.name for entry in fields(cls)]
        if not isinstance(value, Mapping) or set(value) != set(names):
            raise ValueError(f"a limit of shifts has {', '.join(names)}")
        if value["window"] not in SHIFT_WINDOWS:
            raise ValueError(f"{value['name']}: window {value['window']!r}, known {SHIFT_WINDOWS}")
        for name in ("sigma", "k"):
            number = value[name]
            good = isinstance(number, (int, float)) and not isinstance(number, bool)
            if not good or not math.isfinite(number) or not number > 0.0:
                raise ValueError(f"{value['name']}: {name} = {number!r} must be above 0")
        return cls(**value)

    def to_mapping(self) -> dict[str, Any]:
        """Plain mapping of numbers and strings."""
        return asdict(self)


class LevelShift:
    """Shifts of one residual, constant memory; scans singly or in blocks, to the same last bit.

    ``columns`` shift together: the residual, and what its level may follow in a healthy unit.
    ``gated`` is whether samples in motion alone are to be used.
    """

    def __init__(
        self,
        windows: Sequence[int] = SHIFT_WINDOWS,
        columns: int = 1,
        gated: bool = True,
        backend: str = "numpy",
    ) -> None:
        self._windows = np.array(windows)
        self._columns = columns
        self._least = LEAST if gated else LEAST_ALWAYS
        self._compiled = backends.chosen(backend) == "numba"
        self.clear()

    def clear(self) -> None:
        """Forget everything."""
        self._store = np.zeros((_ROOM, self._columns))
        self._end = 1  # the sum of nothing
        self._last = np.full((1, len(self._windows), self._columns), np.nan)
        self._frozen: Array | None = None

    def freeze(self) -> None:
        """From now on every window is held against the earlier level of now."""
        self._frozen = self._earlier(self._store, self._end - 1 - self._windows)

    def step(self, values: Array, use: Flags) -> Array:
        """Shifts after each of n scans, shape (n, windows, columns).

        ``values`` has shape (n, columns). ``use`` says which of them count; after the others
        the last shift stands, NaN before the first.
        Where a value is missing its channel was not to be trusted: a new level begins after it.
        """
        if self._compiled:
            return self._loops(values, use)
        missing = np.isnan(values[:, 0])
        if not missing.any():
            return self._follow(values, use)
        edges = np.flatnonzero(missing[1:] != missing[:-1]) + 1
        parts = zip(np.split(values, edges), np.split(use, edges), strict=True)
        return np.concatenate([self._part(*part) for part in parts])

    def _loops(self, values: Array, use: Flags) -> Array:
        """All of it in one compiled loop."""
        self._make_room(len(values))
        shifts, last = np.empty((len(values), *self._last.shape[1:])), self._last[0].copy()
        is_frozen = self._frozen is not None
        self._end, stays = backends.exact(shift_loops)(
            values,
            use,
            self._store,
            self._end,
            self._windows,
            (REFERENCE, self._least),
            last if self._frozen is None else self._frozen,
            is_frozen,
            last,
            shifts,
        )
        self._last, self._frozen = last[None], self._frozen if stays else None
        return shifts

    def _part(self, values: Array, use: Flags) -> Array:
        """Scans with all values, or with none."""
        if np.isnan(values[0, 0]):
            self.clear()
            return np.repeat(self._last, len(values), axis=0)
        return self._follow(values, use)

    def _follow(self, values: Array, use: Flags) -> Array:
        taken = values[use]
        if not len(taken):
            return np.repeat(self._last, len(values), axis=0)
        shifts = np.concatenate((self._last, self._shifts(self._summed(taken), len(taken))))
        self._last = shifts[-1:]
        return shifts[np.cumsum(use)]

    def _summed(self, taken: Array) -> Array:
        """Sums up to each scan that is still looked back at; the last are those of ``taken``."""
        self._make_room(len(taken))
        start, end = self._end, self._end + len(taken)
        self._store[start:end] = taken
        # One after the other, however many come at once.
        self._store[start - 1 : end] = np.add.accumulate(self._store[start - 1 : end], axis=0)
        self._end = end
        return self._store[:end]

    def _make_room(self, count: int) -> None:
        """For so many scans and many more: one that comes alone moves none of the others."""
        if self._end + count > len(self._store):
            kept = self._store[max(self._end - _KEPT, 0) : self._end]
            self._store = np.empty((len(kept) + count + _ROOM, self._columns))
            self._store[: len(kept)] = kept
            self._end = len(kept)

    def _shifts(self, sums: Array, count: int) -> Array:
        """Shifts at the last ``count`` sums, shape (count, windows, columns)."""
        last = np.arange(len(sums) - count, len(sums))[:, None]
        begins = last - self._windows
        means = (sums[last] - sums[np.maximum(begins, 0)]) / self._windows[:, None]
        if self._frozen is None:
            return np.asarray(means - self._earlier(sums, begins))
        means -= self._frozen
        means[begins < 0] = np.nan
        return np.asarray(means)

    def _earlier(self, sums: Array, begins: Counts) -> Array:
        """Mean of what lies before windows that begin there, NaN where that is too little."""
        samples = np.minimum(begins, REFERENCE)
        enough = np.where(samples >= self._least, samples, np.nan)[..., None]
        before = sums[np.maximum(begins, 0)] - sums[np.maximum(begins - REFERENCE, 0)]
        return np.asarray(before / enough)


def limit_of(
    name: str, window: int, shifts: Sequence[Array], least_k: float, guard: float
) -> ShiftLimit | None:
    """Limit of one window from its shifts in nominal recordings, None where too few have any.

    The limit is ``least_k`` sigmas, and at least ``guard`` times the largest shift seen.
    """
    known = [column[np.isfinite(column)] for column in shifts]
    known = [column for column in known if len(column)]
    if len(known) < 2:
        return None
    sigma = float(np.mean([np.mean(np.square(column)) for column in known])) ** 0.5
    if not sigma > 0.0:
        return None
    largest = max(float(np.abs(column).max()) for column in known)
    return ShiftLimit(name, window, sigma, max(least_k, guard * largest / sigma))
