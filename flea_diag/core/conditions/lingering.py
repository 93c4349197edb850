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

"""A condition of single scans that lasts for as long as a smoothing kernel holds them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

Flags = npt.NDArray[np.bool_]


class Lingering:
    """Evidence in one scan counts for that scan and those after it, ``scans`` in all."""

    def __init__(self, scans: int) -> None:
        self._scans = scans
        self._wait = 0

    @property
    def lasts(self) -> bool:
        """Whether earlier evidence counts in the next scan."""
        return self._wait > 0

    def step(self, evidence: Sequence[bool]) -> Flags | None:
        """Where it counts in n scans, shape (n,); None where in none."""
        if not self._wait and True not in evidence:
            return None
        return np.array([self._counts(seen) for seen in evidence])

    def _counts(self, seen: bool) -> bool:
        if seen:
            self._wait = self._scans
        counts = self._wait > 0
        self._wait -= counts
        return counts
