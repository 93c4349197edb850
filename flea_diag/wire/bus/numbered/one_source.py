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

"""One source a stream: of several publishers the first is used as long as it delivers.

rclpy does not say who has sent a message. Each writer numbers its own, so the numbers that go on
from the last one used are its next; where the graph knows a second publisher, others are not. Where
the numbers of two are close, as of nodes that were started together, their stamps tell them apart:
those of a source keep their place within its period. Two that keep the same place cannot be told
apart, and neither is used.
"""

from __future__ import annotations

import time
from collections.abc import Callable

from flea_diag.wire.messages.cdr import CdrReader

SILENT_S = 1.0
"""Silence of the source in use after which another one is taken."""
MOST_LOST = 100
"""Most numbers that may be missing in those of the source in use."""
CLOSE = 8
"""Numbers of another source so close to those of the one in use may be taken for its next."""
BESIDE = 0.2
"""Part of a period by which a stamp of another source is beside those of the one in use."""


class OneSource:
    """Tells the messages of the source in use from those of another one.

    Parameters
    ----------
    writers : returns the present number of writers; asked at a gap alone
    now_s : a steady clock; by default that of the system
    """

    def __init__(
        self, writers: Callable[[], int], now_s: Callable[[], float] | None = None
    ) -> None:
        self._writers, self._now_s = writers, now_s or time.monotonic
        self._last: int | None = None
        self._other: int | None = None
        self._taken_s = 0.0
        self._used: tuple[bytes, bytes] = b"", b""
        """The last two messages that were used; their stamps are read where they are needed."""
        self._same_place = False
        """Whether two sources were found that keep the same place."""

    def admits(self, number: int | None, data: bytes = b"") -> bool:
        """Whether a message with this number is to be used; None: it has none, and is."""
        if number is None:
            return True
        now_s, last = self._now_s(), self._last
        next_one = last is None or (number == last + 1 and not self._is_close(number))
        if next_one or not self._is_other(number, now_s, data):
            self._last, self._taken_s = number, now_s
            self._used = self._used[1], data
            return True
        self._other = number
        return False

    def _is_close(self, number: int) -> bool:
        return self._other is not None and abs(number - self._other) <= CLOSE

    def _is_other(self, number: int, now_s: float, data: bytes) -> bool:
        if now_s - self._taken_s > SILENT_S or self._writers() <= 1:
            self._other, self._same_place = None, False
            return False
        lost = number - (self._last or 0) - 1
        if self._is_close(number) and all(self._used) and data:
            beside = self._beside(data)
            self._same_place |= lost < 0 and not beside
            return beside or lost < 0 or self._same_place
        if not 0 <= lost <= MOST_LOST:
            return True
        return self._other is not None and 0 <= number - self._other - 1 < lost

    def _beside(self, data: bytes) -> bool:
        """Whether a message is not at the place of the source in use within its period."""
        before, last, this = (_stamp_ns(each) for each in (*self._used, data))
        periods = (this - last) / max(last - before, 1)
        return abs(periods - round(periods)) > BESIDE


def _stamp_ns(data: bytes) -> int:
    return CdrReader(data).stamp_ns()
