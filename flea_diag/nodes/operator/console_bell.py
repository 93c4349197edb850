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

"""When the console rings: at once for a new alarm, then again until all are acknowledged."""

from __future__ import annotations

import math
import time
from collections.abc import Hashable

RING_EVERY_S = 5.0


class Bell:
    """Remembers which alarms have been rung for, and when."""

    def __init__(self) -> None:
        self._heard: set[Hashable] = set()
        self._rang_s = -math.inf

    def due(self, ringing: set[Hashable]) -> bool:
        """Whether to ring now for these alarms."""
        silent_s = time.monotonic() - self._rang_s
        rings = bool(ringing - self._heard) or (bool(ringing) and silent_s >= RING_EVERY_S)
        if rings:
            self._rang_s = time.monotonic()
        self._heard = ringing
        return rings
