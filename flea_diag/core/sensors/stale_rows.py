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

"""Stale rows: a frozen driver repeats its last values under new timestamps."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]
Flags = npt.NDArray[np.bool_]

LEAST_CHANNELS = 3
"""This many noisy channels never repeat all at once by chance."""


class StaleRows:
    """Compares each row with the one before it, across blocks."""

    def __init__(self, channels: int) -> None:
        self.last = np.full(channels, np.nan)
        """The last row; NaN equals nothing, so the first row is never stale."""

    def find(self, rows: Array) -> Flags | None:
        """Which of n >= 1 rows repeat the row before, shape (n,); None where none does.

        A row is stale when all channels repeat, at least ``LEAST_CHANNELS`` of them measured.
        """
        before = np.concatenate((self.last[None], rows[:-1]))
        self.last = rows[-1].copy()
        same = rows == before
        many = np.add.reduce(same, axis=1) >= LEAST_CHANNELS
        if not many.any():
            return None
        same |= np.isnan(rows) & np.isnan(before)
        stale: Flags = many & same.all(axis=1)
        return stale if stale.any() else None
