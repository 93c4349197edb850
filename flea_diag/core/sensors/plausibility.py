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

"""Plausibility of a voltage channel that no second source corroborates.

A voltage that disagrees with current and motion by more than any healthy unit or winding fault
can explain is a bad channel. The test uses the smoothed electrical residual: implausible samples
are dropped at once, ``ENTER_S`` of them in a row make the channel bad, and
``CLEAN_S`` of plausible ones make it good again.
"""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from flea_diag.core.scan_counts import ScanCounts

Array = npt.NDArray[np.float64]
Flags = npt.NDArray[np.bool_]

ENTER_S, CLEAN_S = 0.2, 10.0
"""Time implausible, and plausible again: a channel is lost sooner than it is trusted anew."""


class VoltagePlausibility:
    """Tests the electrical residual (V) of one stream."""

    def __init__(self, limit_v: float, counts: ScanCounts) -> None:
        self._limit_v = limit_v
        self._enter, self._again = counts.of(ENTER_S), counts.of(CLEAN_S)
        self._implausible = 0
        self._clean = self._again
        self.bad = False

    def step(self, residual_v: float) -> bool:
        """Whether this sample is usable."""
        if math.isnan(residual_v):
            return not self.bad
        if abs(residual_v) > self._limit_v:
            self._implausible += 1
            self._clean = 0
            self.bad = self.bad or self._implausible >= self._enter
            return False
        self._implausible = 0
        self._clean += 1
        if self.bad and self._clean >= self._again:
            self.bad = False
        return not self.bad

    def follow(self, residual_v: Array) -> tuple[Flags, Flags]:
        """``step`` for n samples: which are usable, and whether the channel was bad before each."""
        if len(residual_v) == 1:
            before = self.bad
            return np.array([self.step(float(residual_v[0]))]), np.array([before])
        if not self.bad and not (np.abs(residual_v) > self._limit_v).any():
            known = int(np.isfinite(residual_v).sum())
            self._implausible = 0 if known else self._implausible
            self._clean += known
            return np.ones(len(residual_v), dtype=bool), np.zeros(len(residual_v), dtype=bool)
        usable, bad = [], []
        for value in residual_v.tolist():
            bad.append(self.bad)
            usable.append(self.step(value))
        return np.array(usable), np.array(bad)


def usable(residual_v: Array, limit_v: float, counts: ScanCounts) -> Flags:
    """Which samples of a whole recording are usable, shape as given."""
    return VoltagePlausibility(limit_v, counts).follow(residual_v)[0]
