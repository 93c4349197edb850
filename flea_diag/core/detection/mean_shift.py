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

"""Mean-shift test: change of the level of a residual within a run.

What healthy units differ by, a zero that nothing corroborates or a resistance that nobody
measured, stays what it is throughout a run. So the mean of the last w samples less the mean
of those before them knows nothing of it, and what is left to be told from a fault is a
fraction of what the calibration must allow any unit:

    d = mean(last w) - mean(up to REFERENCE_S before them),   |d| > k sigma   ->  symbol

A step or a drift of a sensor shows, wherever the level of its relation was; what was there
from the start does not, and is left to the tests against the calibration (``detection``). From
a detection on, the earlier level is frozen.
"""

from __future__ import annotations

from collections.abc import Sequence
from copy import copy, deepcopy
from dataclasses import asdict, dataclass
from itertools import pairwise
from typing import Annotated, Any

import numpy as np
import numpy.typing as npt

from flea_diag.core.flat_state import Flat, FlatState
from flea_diag.core.frozen import Frozen
from flea_diag.core.scan_counts import ScanCounts
from flea_diag.fields.values import Positive, within

Array = npt.NDArray[np.float64]
Flags = npt.NDArray[np.bool_]
Counts = npt.NDArray[np.int64]
Memory = tuple[Array, Flat]
"""Sums up to each scan that is still looked back at, and the tables of ``SHIFT``."""
SHIFT = LAST, FROZEN, ENDS, IS_FROZEN, GAPS, LONGEST, LEAST, WINDOWS, REFERENCE = range(9)
"""Last shifts, and earlier levels that are frozen; where the sums end, and whether levels are
frozen; for how long values have been missing, and may be; how few samples make a level, the
windows, and how many samples a level reaches back."""

SHIFT_WINDOWS_S = (2.0, 4.0)
"""Means compared with the earlier level: the shorter is sooner, the longer sees less."""
REFERENCE_S, LEAST_S = 20.0, 3.0
"""Longest and shortest mean that is the earlier level."""
LEAST_ALWAYS_S = 6.0
"""Shortest for a residual that is also tested at rest: strokes and rests alternate in its level."""
GAP_S = 0.5
"""Longest gap that a level outlasts: a reading that leaps is withheld for some scans, and missing
for a smoothing kernel after them. Parts that a gap sets free leap, too."""
_ROOM = 1000  # scans between two moves of the store


@dataclass(frozen=True, slots=True)
class MeanShiftLimit(Frozen):
    """Sigma of the mean shift of one residual over ``window`` scans, and its limit in sigmas.

    ``along`` names the reading whose coefficient shifts (``coefficient_shift``), and sigma is then
    the noise of a sample of the residual; empty: the mean does.
    """

    name: str
    window: Annotated[int, within(1, 10**6)]
    sigma: Positive
    k: Positive
    along: str = ""

    def to_mapping(self) -> dict[str, Any]:
        """Plain mapping of numbers and strings; a mean is as in files that know nothing else."""
        plain = asdict(self)
        if not self.along:
            plain.pop("along")
        return plain


class MeanShift:
    """Shifts of residuals side by side, constant memory; scans singly or in blocks, the same bits.

    ``columns`` of each shift together: the residual, and what its level may follow in a healthy
    unit. Of the last ``added`` the two means are added, as variances are. ``gated`` is, for each
    residual, whether samples in motion alone are to be used.
    """

    def __init__(
        self,
        gated: Sequence[bool] = (True,),
        columns: int = 1,
        added: int = 0,
        *,
        counts: ScanCounts,
    ) -> None:
        self.windows = np.array([counts.of(time_s) for time_s in SHIFT_WINDOWS_S])
        self._reference = counts.of(REFERENCE_S)
        self._kept = self._reference + int(self.windows.max()) + 1
        self.columns = columns
        shape = (len(gated), len(self.windows))
        self._longest = counts.of(GAP_S)
        self._least = np.where(gated, counts.of(LEAST_S), counts.of(LEAST_ALWAYS_S))
        self._store = np.zeros((len(gated), self._kept + _ROOM, columns))
        self._free = 0
        """Scans that there is room for at least."""
        unknown = np.full((*shape, columns), np.nan)
        self._state = FlatState(
            {"last": unknown, "frozen": unknown},
            {
                "ends": np.ones(len(gated)),  # the sum of nothing
                "is_frozen": np.zeros(len(gated)), "gaps": np.zeros(len(gated)),
                "longest": self._longest, "least": self._least, "windows": self.windows,
                "reference": self._reference,
            },
        )  # fmt: skip
        self._sign = np.where(np.arange(columns) < columns - added, 1.0, -1.0)

    @property
    def _ends(self) -> Counts:
        return self._state.table["ends"]

    @property
    def _last(self) -> Array:
        return self._state.table["last"]

    @property
    def _frozen(self) -> Array:
        return self._state.table["frozen"]

    @property
    def _is_frozen(self) -> Counts:
        return self._state.table["is_frozen"]

    def clear(self) -> None:
        """Forget everything."""
        for each in range(len(self._ends)):
            self._begin(each)

    def _begin(self, each: int) -> None:
        """A new level of one residual."""
        self._store[each, 0], self._ends[each] = 0.0, 1
        self._last[each], self._is_frozen[each] = np.nan, False

    def freeze(self) -> None:
        """Compare every window with the present earlier level from now on."""
        self.thaw([False] * len(self._ends))

    def thaw(self, rolls: Sequence[bool]) -> None:
        """Compare windows of each residual with what is before them, or from now on as ``freeze``.

        What is frozen already keeps the level that it has.
        """
        for each, (end, roll) in enumerate(zip(self._ends.tolist(), rolls, strict=True)):
            if not (roll or self._is_frozen[each]):
                self._frozen[each] = self._earlier(each, end - 1 - self.windows)
            self._is_frozen[each] = not roll

    def step(self, values: Array, use: Flags) -> Array:
        """Shifts after each of n scans, shape (n, residuals, windows, columns).

        ``values`` has shape (n, residuals, columns). ``use``, shape (n, residuals), says which of
        them count; after the others the last shift stands, NaN before the first.
        Where values are missing for longer than ``GAP_S`` their channel was not to be trusted: a
        new level begins after them.
        """
        self.room(len(values))
        shifts = np.empty((len(values), *self._last.shape))
        for each in range(len(self._ends)):
            missing = np.isnan(values[:, each, 0])
            lost, counts = self._lost(each, missing), use[:, each] & ~missing
            edges = [0, *(np.flatnonzero(lost[1:] != lost[:-1]) + 1).tolist(), len(values)]
            for start, end in pairwise(edges):
                part = slice(start, end)
                if lost[start]:
                    self._begin(each)
                    shifts[part, each] = np.nan
                else:
                    shifts[part, each] = self._follow(each, values[part, each], counts[part])
        return shifts

    def _lost(self, each: int, missing: Flags) -> Flags:
        """Where the values of one residual have been missing for too long."""
        scans = np.arange(len(missing))
        gaps = self._state.table["gaps"]
        last = np.maximum.accumulate(np.where(missing, -1 - gaps[each], scans))
        gaps[each] = scans[-1] - last[-1]
        return np.asarray(scans - last > self._longest)

    def room(self, count: int) -> Memory:
        """State updated by ``mean_shift_test_loops``, with room for a block of scans."""
        self._free -= count
        if self._free < 0:
            store = self._store
            if self._kept + count > store.shape[1]:
                self._store = np.zeros((len(store), self._kept + count + _ROOM, store.shape[2]))
            self._move(store)
            self._free = self._store.shape[1] - int(self._ends.max(initial=0)) - count
        return self._store, self._state.flat

    def _move(self, store: Array) -> None:
        """Put the sums that are still looked back at to the front."""
        for each, end in enumerate(self._ends.tolist()):
            kept = store[each, max(end - self._kept, 0) : end].copy()
            self._store[each, : len(kept)], self._ends[each] = kept, len(kept)

    def __deepcopy__(self, memo: object) -> MeanShift:
        """With these sums alone: what lies before them is room."""
        made = copy(self)
        made._state = deepcopy(self._state)
        made._store = np.empty_like(self._store)
        made._move(self._store)
        return made

    def _follow(self, each: int, values: Array, use: Flags) -> Array:
        """Scans of one residual that have a value."""
        taken, last = values[use], self._last[each, None]
        if not len(taken):
            return np.repeat(last, len(values), axis=0)
        start, end = int(self._ends[each]), int(self._ends[each]) + len(taken)
        sums = self._store[each]
        sums[start:end] = taken
        # One after the other, however many come at once.
        sums[start - 1 : end] = np.add.accumulate(sums[start - 1 : end], axis=0)
        shifts = np.concatenate((last, self._shifts(each, np.arange(start, end)[:, None])))
        self._ends[each], self._last[each] = end, shifts[-1]
        return np.asarray(shifts[np.cumsum(use)])

    def _shifts(self, each: int, last: Counts) -> Array:
        """Shifts at these sums, shape (count, windows, columns)."""
        sums, begins = self._store[each], last - self.windows
        means = (sums[last] - sums[np.maximum(begins, 0)]) / self.windows[:, None]
        if not self._is_frozen[each]:
            return np.asarray(means - self._sign * self._earlier(each, begins))
        shifts = np.asarray(means - self._sign * self._frozen[each])
        shifts[begins < 0] = np.nan
        return shifts

    def _earlier(self, each: int, begins: Counts) -> Array:
        """Mean of what lies before windows that begin there, NaN where that is too little."""
        sums, samples = self._store[each], np.minimum(begins, self._reference)
        enough = np.where(samples >= self._least[each], samples, np.nan)[..., None]
        before = sums[np.maximum(begins, 0)] - sums[np.maximum(begins - self._reference, 0)]
        return np.asarray(before / enough)
