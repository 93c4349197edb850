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

"""Detects a change of the unit under test: several thermocouples step together.

Heating takes minutes, and a sensor fault moves one reading. Two temperatures that step within
the same tenth of a second therefore come from the thermocouples of another unit. This is no
fault; the offsets of the new unit are learned from the start. A reading that steps and then stands
still, where each one differed from the last before, is of no unit: it has died.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from flea_diag.core.smoothing import sliding

Array = npt.NDArray[np.float64]
Flags = npt.NDArray[np.bool_]

BEFORE, AFTER = 100, 12
"""Scans before and after a step; medians of them, because thermocouples spike."""
LENGTH = BEFORE + AFTER
PERIOD = 4
"""Interval of the test in scans."""
LIMIT = 6.0
"""Limit of a step in standard errors; two channels at once reach at most 3.6 in the public
recordings of the FLEA, 0.16 million scans."""
LEAST_STEP_K = 0.3  # noise of a thermocouple
TOGETHER = 2
"""Number of channels that must step."""
STILL = AFTER // 2 - 1
"""Differences of readings after a step that are all 0 where it has died."""
LIVELY = 0.25
"""Share of the differences before it that are not 0 where no reading is held for long: half of them
may be after the step."""
MEDIAN_ERROR = np.sqrt(np.pi / 2.0 * (1.0 / BEFORE + 1.0 / AFTER))
"""Standard error of a difference of medians of normal noise, in sigmas of the noise."""
MAD_SIGMA = 1.4826  # of a Gaussian
MEANS_APART = np.repeat([-1.0 / BEFORE, 1.0 / AFTER], [BEFORE, AFTER])
"""Weights of a window for the mean after a step minus the mean before it."""


class UnitChange:
    """Tests a stream of temperatures, shape (n, channels), degC; NaN is not tested."""

    def __init__(self) -> None:
        self.forget()

    def forget(self) -> None:
        """A stream begins."""
        self._rows: list[Array] = []
        self._count = 0

    def follow(self, temperatures: Array) -> int:
        """Take n scans; the first at which another unit is detected, or n."""
        n = len(temperatures)
        # The same scans are tested for any block lengths.
        first = (-self._count - 1) % PERIOD
        self._count += n
        self._rows.append(temperatures)
        if first >= n:
            return n
        rows = np.ascontiguousarray(np.concatenate(self._rows))
        self._rows = [rows[1 - LENGTH :]]
        if len(rows) < LENGTH:
            return n
        # Start of the window that ends with the first scan that is due.
        begins = len(rows) - n + first + 1 - LENGTH
        if begins < 0:
            begins %= PERIOD
        seen = _together(sliding(rows, LENGTH)[begins::PERIOD])
        if not np.count_nonzero(seen):
            return n
        return begins + LENGTH - 1 - (len(rows) - n) + PERIOD * int(seen.argmax())


def _together(windows: Array) -> Flags:
    """Whether enough channels step at the end of each of m windows, (m, scans, channels)."""
    seen = _enough(np.abs(MEANS_APART @ windows) > 0.5 * LEAST_STEP_K)
    # Means are cheap but sensitive to spikes: the medians of these few windows decide.
    if np.count_nonzero(seen):
        seen[seen] = _surely(windows[seen])
    return seen


def _surely(windows: Array) -> Flags:
    before = windows[:, :BEFORE]
    middle = _medians(before)
    step = np.abs(_medians(windows[:, BEFORE:]) - middle)
    step[_died(windows)] = 0.0
    seen = _enough(step > LEAST_STEP_K)
    if seen.any():
        apart = np.abs(before[seen] - middle[seen, None])
        sigma = MAD_SIGMA * _medians(apart)
        seen[seen] = _enough(step[seen] > np.maximum(LIMIT * MEDIAN_ERROR * sigma, LEAST_STEP_K))
    return seen


def _died(windows: Array) -> Flags:
    """Which channels stand still at the end of each window, and did not before."""
    differs = np.diff(windows, axis=1) != 0.0
    lively = differs[:, :BEFORE].mean(axis=1) > LIVELY
    died: Flags = lively & ~differs[:, -STILL:].any(axis=1)
    return died


def _medians(windows: Array) -> Array:
    """Medians over an even number of scans: sorting is several times faster than numpy's median."""
    ordered, half = np.sort(windows, axis=1), windows.shape[1] // 2
    middle = 0.5 * (ordered[:, half - 1] + ordered[:, half])
    return np.where(np.isnan(ordered[:, -1]), np.nan, middle)


def _enough(stepped: Flags) -> Flags:
    together: Flags = np.add.reduce(stepped, axis=-1) >= TOGETHER
    return together
