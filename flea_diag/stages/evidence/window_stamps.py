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

"""When the windows of a history end: stamps for numbers, as records have them."""

from __future__ import annotations

from bisect import bisect_right
from collections import deque

from flea_diag.core.evidence.fault_evidence import KEPT_WINDOWS


class WindowStamps:
    """Stamp of the last scan of each window that a ``StreamHistory`` keeps."""

    def __init__(self) -> None:
        self._ends: deque[int] = deque(maxlen=KEPT_WINDOWS)
        self._taken = 0

    def add(self, stamp_ns: int) -> None:
        """One more window has ended."""
        self._ends.append(stamp_ns)
        self._taken += 1

    def before(self, number: int) -> int:
        """Stamp of the last scan before a window; 0 where it is older than what is kept."""
        place = number - 1 - (self._taken - len(self._ends))
        return self._ends[place] if place >= 0 else 0

    def number(self, stamp_ns: int) -> int:
        """Number of the window that begins after a stamp, as far back as they are kept."""
        return self._taken - len(self._ends) + bisect_right(self._ends, stamp_ns)
