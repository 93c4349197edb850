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

"""Shift of a coefficient of a residual on a reading, whatever its unit's parameters are.

What units differ by is constant within a run but does not look so: a resistance of its own moves
the residual with the current. A test of means must allow for that by the tolerances, which hide
what a change within the run does. So the run tells its unit's parameters eta itself. With
psi = d r / d eta, scaled by the tolerances, a reading y and white noise e,

    r = psi' eta + b y [within the last w] + e,   eta ~ N(0, 1),

b and its error follow from least squares over the window and what came before it:

    z = (sum y r - h' A^-1 g) / (sigma sqrt(D)),   D = sum y^2 - h' A^-1 h,
    A = sum psi psi' + sigma^2,   g = sum psi r,   h = sum psi y,

sums with y over the last w, the others over both. A parameter that follows the temperature of a
predicted store does not stay what it is: what is heated is ahead of what is measured. So psi holds
it two more times, in proportion to two means of what heats that store (``Heating``). From a
detection on what came before is frozen. Sums are taken over bins of scans, so blocks of scans and
single ones give the same bits.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from flea_diag.core.detection.mean_shift import (
    GAP_S,
    LEAST_S,
    REFERENCE_S,
    SHIFT_WINDOWS_S,
)
from flea_diag.core.scan_counts import ScanCounts

Array = npt.NDArray[np.float64]
Flags = npt.NDArray[np.bool_]
Counts = npt.NDArray[np.int64]

COEFFICIENT_WINDOWS_S = (*SHIFT_WINDOWS_S, 8.0, 16.0)
"""A small change that stays has its power in long windows."""
BIN_S = 0.5
"""Time in which samples count as one independent sample, and by which windows move on."""
LEAST_LEFT = 1e-6
"""Share of a reading that its unit's parameters must leave, against rounding."""
_MOST = 100  # bins between two moves of the store


class CoefficientShift:
    """Shifts of the coefficients of one residual on some readings; constant memory.

    Of ``units`` parameters of the unit and ``readings`` readings; ``sigma`` is the noise of a
    sample.
    """

    def __init__(self, units: int, readings: int, sigma: float, *, counts: ScanCounts) -> None:
        self._units, self._readings = units, readings
        self._bin, self._gap, self._longest = counts.of(BIN_S), 0, counts.of(GAP_S)
        self._variance = sigma**2 * self._bin
        self._bins = np.array([round(time_s / BIN_S) for time_s in COEFFICIENT_WINDOWS_S])
        self._reference = round(REFERENCE_S / BIN_S)
        self._least = round(LEAST_S / BIN_S)
        self.clear()

    def clear(self) -> None:
        """Forget everything."""
        width = self._units + 2 + self._readings
        self._sums = np.zeros((1, width, width))
        """Products of psi, 1, residual and readings, summed up to the end of each bin."""
        self._pending = np.zeros((0, width - 1))
        self._last = np.full((2, self._readings, len(self._bins)), np.nan)
        self._frozen: Array | None = None

    def freeze(self) -> None:
        """Hold every window against what has come before it until now."""
        self.thaw(rolls=False)

    def thaw(self, rolls: bool) -> None:
        """Hold every window against what comes before it, or from now on as ``freeze``."""
        if rolls:
            self._frozen = None
        elif self._frozen is None:
            self._frozen = self._before(len(self._sums) - 1 - self._bins)

    def step(self, rows: Array, use: Flags) -> Array:
        """Z after each of n scans, and the shift in the unit of the residual, signed as b y is now.

        Shape (n, 2, readings, windows), NaN where there is too little. ``rows``, shape
        (n, units + 1 + readings), are psi, the residual and the readings; ``use`` says which count.
        Where the residual is missing for longer than ``GAP_S`` its channel was not to be trusted:
        all begins anew after it.
        """
        found = np.empty((len(rows), *self._last.shape))
        scans, missing = np.arange(len(rows)), np.isnan(rows[:, self._units])
        seen = np.maximum.accumulate(np.where(missing, -1 - self._gap, scans))
        self._gap = int(scans[-1] - seen[-1])
        lost, use = scans - seen > self._longest, use & ~missing
        edges = np.flatnonzero(lost[1:] != lost[:-1]) + 1
        for part in np.split(scans, edges) if len(edges) else (scans,):
            if lost[part[0]]:
                self.clear()
                found[part] = np.nan
            else:
                found[part] = self._follow(rows[part], use[part])
        return found

    def _follow(self, rows: Array, use: Flags) -> Array:
        """Scans that have a residual."""
        full = (len(self._pending) + np.cumsum(use)) // self._bin
        ends = self._add(rows[use])
        if not len(ends):
            return np.broadcast_to(self._last, (len(rows), *self._last.shape))
        found = np.concatenate((self._last[None], self._shifts(ends)))
        self._last = found[-1]
        kept = self._reference + int(self._bins.max()) + 1
        if len(self._sums) > kept + _MOST:
            self._sums = self._sums[-kept:].copy()
        return np.asarray(found[full])

    def _add(self, taken: Array) -> Counts:
        """Fill bins; the places of the full ones among the sums."""
        rows = np.concatenate((self._pending, taken))
        count, first = len(rows) // self._bin, len(self._sums)
        self._pending = rows[count * self._bin :].copy()
        if count:
            rows = np.insert(rows[: count * self._bin], self._units, 1.0, axis=1)
            products = (rows[:, :, None] * rows[:, None, :]).reshape(count, self._bin, -1)
            # One after the other, however many come at once.
            bins = np.add.accumulate(products, axis=1)[:, -1].reshape(count, *self._sums.shape[1:])
            added = np.add.accumulate(np.concatenate((self._sums[-1:], bins)), axis=0)
            self._sums = np.concatenate((self._sums, added[1:]))
        return np.arange(first, len(self._sums))

    def _before(self, begins: Counts) -> Array:
        """Sums of what lies before windows that begin there, NaN where that is too little."""
        near, far = (self._sums[np.maximum(b, 0)] for b in (begins, begins - self._reference))
        enough = np.minimum(begins, self._reference) >= self._least
        return np.where(enough[..., None, None], near - far, np.nan)

    def _shifts(self, ends: Counts) -> Array:
        """Z and shifts at the ends of these bins, shape (bins, 2, readings, windows)."""
        k, begins = self._units, ends[:, None] - self._bins
        last = self._sums[ends][:, None] - self._sums[np.maximum(begins, 0)]
        before = self._before(begins) if self._frozen is None else self._frozen
        every = np.where((begins >= 0)[..., None, None], before + last, np.nan)
        known = np.isfinite(every[..., 0, 0])
        every[~known] = 0.0
        own = every[..., :k, :k] + self._variance * np.eye(k)
        along = last[..., :k, k + 2 :]
        weights = np.linalg.solve(own, along)
        top = last[..., k + 1, k + 2 :] - _over_units(weights * every[..., :k, k + 1, None])
        square = np.diagonal(last[..., k + 2 :, k + 2 :], axis1=-2, axis2=-1)
        left = square - _over_units(weights * along)
        known = known[..., None] & (left > LEAST_LEFT * square)
        with np.errstate(invalid="ignore", divide="ignore"):
            z = top / np.sqrt(self._variance * left)
            shift = top / left * np.sqrt(square / (self._bins[:, None] * self._bin))
        now = self._sums[ends, k, k + 2 :] - self._sums[ends - 1, k, k + 2 :]
        side = np.where(now < 0.0, -1.0, 1.0)[:, None]
        found = np.where(known[:, None], np.stack((side * z, side * shift), axis=1), np.nan)
        return found.swapaxes(-1, -2)


def _over_units(values: Array) -> Array:
    """Sums over the last axis but one, in order."""
    sums = np.zeros((*values.shape[:-2], values.shape[-1]))
    for unit in range(values.shape[-2]):
        sums = sums + values[..., unit, :]
    return sums
