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

"""Means of residuals and basis signals over windows: what is tested is slower than a scan."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class ResidualWindow:
    """Means over one window: residuals, shape (residuals,), NaN where there is none.

    ``regressors``, shape (residuals, signals): of the scans in which each residual has a value.
    """

    values: Array
    regressors: Array


class WindowMeans:
    """Windows of so many scans from scans in order, whatever their blocks."""

    def __init__(self, scans: int) -> None:
        self._scans = scans
        self._values: list[Array] = []
        self._regressors: list[Array] = []

    def add(self, values: Array, regressors: Array) -> Iterator[tuple[int, ResidualWindow]]:
        """Take n scans: residuals, shape (n, residuals), NaN = none; signals, shape (n, signals).

        Yields
        ------
        Number of the scan of this block that completes a window, and the window.
        """
        for number, (row, signals) in enumerate(zip(values, regressors, strict=True)):
            self._values.append(row)
            self._regressors.append(signals)
            if len(self._values) == self._scans:
                yield number, self._mean()

    def _mean(self) -> ResidualWindow:
        """The mean of each residual that most of the scans have."""
        values, signals = np.array(self._values), np.nan_to_num(np.array(self._regressors))
        self._values.clear()
        self._regressors.clear()
        known = np.isfinite(values)
        count = known.sum(axis=0)
        enough = 2 * count > len(values)
        share = known / np.maximum(count, 1)
        means = np.where(enough, (np.nan_to_num(values) * share).sum(axis=0), np.nan)
        return ResidualWindow(means, share.T @ signals)
