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

"""Rows of one stream: what each window leaves of the relations, in standard deviations of the law.

What the stream itself differs by is told from its quiet windows alone, so that a fault that comes
and goes is not learned.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from flea_diag.core.evidence.hypotheses import StreamHypotheses
from flea_diag.core.evidence.stream_windows import LawWindow
from flea_diag.core.evidence.white_stream import (
    exact_share,
    predicted_sigma,
    standardised,
    weight_of,
)
from flea_diag.core.frozen import Frozen
from flea_diag.core.recurrence.recurring import FAR, NEAR
from flea_diag.core.run_law.run_windows import WINDOW_S

Array = npt.NDArray[np.float64]
Flags = npt.NDArray[np.bool_]

SOLVED_EVERY = 5
"""Windows from one solution for what the stream differs by to the next: 1 s."""


@dataclass(frozen=True, eq=False)
class WindowRow(Frozen):
    """One window.

    Attributes
    ----------
    errors
        Of prediction under no fault, in standard deviations, shape (relations,), 0 without a value.
    faults
        What one unit of each size adds to them, shape (relations, models * sizes).
    unit
        What another unit adds, for one standard deviation of each of its differences, shape
        (relations, differences).
    """

    errors: Array
    faults: Array
    unit: Array

    @property
    def farthest(self) -> float:
        """Standard deviations that the farthest relation is out."""
        return float(np.abs(self.errors).max())


class StreamRows:
    """Makes the rows of one stream, window by window.

    ``fast``, shape (relations,): those that are looked at. A slow store is predicted from a
    detection on without a correction, and says nothing of a burst.
    """

    def __init__(self, hypotheses: StreamHypotheses, fast: Flags) -> None:
        self._h, self._fast = hypotheses, fast
        self._fade = math.exp(-WINDOW_S / hypotheses.memory_s)
        noise = hypotheses.noise
        # Neighbouring windows are alike: of what lasts they tell less than their number says.
        self._alike = np.maximum(noise.long_run / noise.sigma, 1.0)[:, None]
        self._one = np.eye(len(fast))
        self._number = 0
        self.forget()

    def forget(self) -> None:
        """Zeros of this unit have been learned: what is left of them is another quantity now."""
        count = self._h.own_count
        self._sums = np.zeros((count, count))
        self._quiet = 0
        self._solve()

    def step(self, window: LawWindow, keeps: bool) -> WindowRow | None:
        """Take the next window; None where it is not kept, as no relation is far out in it."""
        h, known = self._h, np.isfinite(window.values) & self._fast
        left, psi, unit = h.own(window, self._number)
        self._number += 1
        sigma = h.noise.loudness(window.motion) * h.friction.loudness(window) * h.noise.sigma
        rows = np.column_stack((left, psi)) / sigma[:, None]
        rows[~known] = 0.0
        covariance = self._covariance
        errors = standardised(rows, self._eta, covariance)
        # Of a deviation that no model gives exactly, little is the noise of a shared sensor.
        both = known[:, None] & known
        shared = h.noise.shared * np.square(exact_share(errors)[:, 0])
        apart = self._one - np.where(both, shared * sigma / sigma[:, None], 0.0)
        if np.abs(errors).max() <= NEAR:
            self._count(rows * weight_of(errors) / self._alike)
        own = apart @ errors
        if not keeps and np.abs(own).max() <= FAR:
            return None
        added, _ = h.faults(window, errors)
        # Asked of a window that is kept alone: most are quiet.
        predicted = sigma * predicted_sigma(rows, covariance)
        added = np.column_stack((added, unit)) / predicted[:, None]
        added[~known] = 0.0
        added = apart @ added
        differences = unit.shape[1]
        return WindowRow(own, added[:, :-differences], added[:, -differences:])

    def _count(self, rows: Array) -> None:
        self._sums = self._fade * self._sums + rows.T @ rows
        self._quiet += 1
        if self._quiet % SOLVED_EVERY == 0:
            self._solve()

    def _solve(self) -> None:
        """What the stream differs by so far: mean and covariance."""
        inner = np.eye(len(self._sums) - 1) + self._sums[1:, 1:]
        self._covariance = np.asarray(np.linalg.inv(inner), dtype=np.float64)
        self._eta = self._covariance @ self._sums[1:, 0]
