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

"""Progress of the first start after an installation, in which numba compiles."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

from flea_diag.wire.bus import Bus
from flea_diag.wire.records import Health, Level

SHOW_EVERY_S = 1.0
TYPICAL = {"observer": 10, "isolator": 2, "extractor": 2}
"""Functions that a node compiles, as counted on the shipped stands; another stand may have more."""
ALL = 11
"""Functions of the diagnoser, which is all of them."""


class CompileProgress:
    """Counts functions whose compilation begins, for the log and for every screen.

    Parameters
    ----------
    bus
        Bus of the node, which says every few seconds what it is doing.
    clock
        Seconds of any monotonic clock.
    """

    def __init__(self, bus: Bus[Any], clock: Callable[[], float] = time.monotonic) -> None:
        self._bus, self._clock = bus, clock
        self._total = TYPICAL.get(bus.name.rpartition("/")[2], ALL)
        self._functions = 0
        self._begin_s = clock()
        self._shown_s = self._begin_s - SHOW_EVERY_S

    def __call__(self, name: str) -> None:
        """Note that ``name`` is being compiled."""
        self._functions += 1
        self._total = max(self._total, self._functions)
        now_s = self._clock()
        words = self._words(now_s)
        self._bus.doing = f"{words} ({name}); later starts take them from disk"
        if now_s - self._shown_s >= SHOW_EVERY_S:
            self._shown_s = now_s
            self._bus.publish(Health(self._bus.now_ns(), self._bus.name, Level.WARN, words))

    def _words(self, now_s: float) -> str:
        """How far it is, and how long it will still take at the same pace."""
        done = self._functions - 1
        words = f"compiling, {self._functions} of {self._total}"
        if not done:
            return words
        left_s = (now_s - self._begin_s) / done * (self._total - done)
        return f"{words}, about {left_s:.0f} s"
