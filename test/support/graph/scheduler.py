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

"""One clock and one queue of what happens next; of what is due at once the seed decides."""

from __future__ import annotations

import heapq
import itertools
import random
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from unittest.mock import patch

S = 1_000_000_000
START_NS = 1_700_000_000 * S
BOOTED_S = 1000.0
"""What a steady clock shows at the start."""


class Scheduler:
    """Calls what is due, in the order of time.

    Parameters
    ----------
    seed : of everything that is drawn in a run
    """

    def __init__(self, seed: int) -> None:
        self.random = random.Random(seed)
        self.now_ns = START_NS
        self.set_ns = 0
        """By how much somebody has set the clock of the host."""
        self._due: list[tuple[int, float, int, Callable[[], None]]] = []
        self._count = itertools.count()

    def at(self, when_ns: int, call: Callable[[], None]) -> None:
        """Call at a time; of several at the same time in an order that is drawn."""
        entry = (max(when_ns, self.now_ns), self.random.random(), next(self._count), call)
        heapq.heappush(self._due, entry)

    def after(self, seconds: float, call: Callable[[], None]) -> None:
        """Call once this time has passed."""
        self.at(self.now_ns + round(seconds * S), call)

    def run_until(self, end_ns: int) -> None:
        """Everything that is due up to a time."""
        while self._due and self._due[0][0] <= end_ns:
            self.now_ns, _, _, call = heapq.heappop(self._due)
            call()
        self.now_ns = end_ns

    @property
    def wall_ns(self) -> int:
        """Clock of the host, which can be set."""
        return self.now_ns + self.set_ns

    @property
    def steady_s(self) -> float:
        """Clock that nobody can set."""
        return BOOTED_S + (self.now_ns - START_NS) / S

    @contextmanager
    def as_time(self) -> Iterator[None]:
        """Whatever reads a clock meanwhile reads this one; nothing is waited for."""

        def steady_ns() -> int:
            return round(self.steady_s * S)

        with patch.multiple(
            time,
            time=lambda: self.wall_ns / S,
            time_ns=lambda: self.wall_ns,
            monotonic=lambda: self.steady_s,
            monotonic_ns=steady_ns,
            perf_counter=lambda: self.steady_s,
            perf_counter_ns=steady_ns,
            process_time=lambda: self.steady_s,
        ):
            yield
