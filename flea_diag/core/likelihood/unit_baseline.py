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

"""Baseline of a unit: evidence on its own parameters from scans without a deviation.

Healthy units differ, so every likelihood includes a spread of friction, resistance and offsets.
A unit that has run for a while has shown where it lies within that spread. The last seconds before
a detection are left out, as the fault may already be present, and old evidence fades, as a unit
warms up.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from flea_diag.core.likelihood.basis import Basis
from flea_diag.core.likelihood.likelihood import NormalEquations
from flea_diag.core.scan_counts import ScanCounts

Array = npt.NDArray[np.float64]

EVERY_S = 0.04
"""One scan is kept of each such time: residuals change slowly."""
PIECE_S = 1.0  # assumption: size of a sample
LEFT_OUT = 3
"""Pieces before a detection that are left out of the baseline."""
LEAST_PIECES = 5
"""Pieces before the baseline is used: a fault present at start is mostly detected earlier."""
MEMORY = 60.0
"""Pieces over which the evidence fades to 1/e."""


class UnitBaseline:
    """Running evidence of the residuals ``residuals``, constant memory."""

    def __init__(self, residuals: Sequence[str], basis: Basis, counts: ScanCounts) -> None:
        self._piece, self._every = counts.of(PIECE_S), counts.of(EVERY_S)
        self._residuals, self._basis = tuple(residuals), basis
        self._recent: deque[NormalEquations] = deque()
        self._scans = 0
        self._known = NormalEquations(residuals, basis)
        self._pieces = 0

    @property
    def evidence(self) -> NormalEquations | None:
        """The baseline; None while there is too little of it to tell a fault from it."""
        return self._known if self._pieces >= LEAST_PIECES else None

    def add(self, values: Array, regressors: Array) -> None:
        """Add n scans without a deviation: residuals, shape (n, residuals), NaN = none; regressors.

        The result does not depend on the block sizes, to the last bit.
        """
        start = 0
        while start < len(values):
            if self._scans % self._piece == 0:
                self._next_piece()
            count = min(self._piece - self._scans % self._piece, len(values) - start)
            kept = slice(start + -self._scans % self._every, start + count, self._every)
            self._recent[-1].add(values[kept], regressors[kept])
            self._scans += count
            start += count

    def count(self) -> bool:
        """Count one scan; whether to hand it to ``keep`` before its piece is over."""
        if self._scans % self._piece == 0:
            self._next_piece()
        self._scans += 1
        return self._scans % self._every == 1 % self._every

    @property
    def is_piece_over(self) -> bool:
        """Whether the next scan begins another piece."""
        return self._scans % self._piece == 0

    def keep(self, values: Array, regressors: Array) -> None:
        """Add scans of this piece that were counted, in order; shapes as for ``add``."""
        self._recent[-1].add(values, regressors)

    def _next_piece(self) -> None:
        self._recent.append(NormalEquations(self._residuals, self._basis))
        if len(self._recent) > LEFT_OUT + 1:
            self._known.fade(np.exp(-1.0 / MEMORY))
            self._known.take(self._recent.popleft(), self._every)
            self._pieces += 1

    def interrupt(self) -> None:
        """A deviation was detected: discard the scans just before it."""
        self._recent.clear()
        self._scans = 0
