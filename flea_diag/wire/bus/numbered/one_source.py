"""One source a stream: of several publishers the first is used as long as it delivers.

rclpy does not say who has sent a message. Each writer numbers its own, so the numbers that go on
from the last one used are its next; where the graph knows a second publisher, others are not.
"""

from __future__ import annotations

import time
from collections.abc import Callable

SILENT_S = 1.0
"""Silence of the source in use after which another one is taken."""
MOST_LOST = 100
"""Most numbers that may be missing in those of the source in use."""


class OneSource:
    """Tells the messages of the source in use from those of another one.

    Parameters
    ----------
    writers : returns the present number of writers; asked at a gap alone
    now_s : a steady clock
    """

    def __init__(
        self, writers: Callable[[], int], now_s: Callable[[], float] = time.monotonic
    ) -> None:
        self._writers, self._now_s = writers, now_s
        self._last: int | None = None
        self._other: int | None = None
        self._taken_s = 0.0

    def admits(self, number: int | None) -> bool:
        """Whether a message with this number is to be used; None: it has none, and is."""
        if number is None:
            return True
        now_s, last = self._now_s(), self._last
        if last is None or number == last + 1 or not self._is_other(number, last, now_s):
            self._last, self._taken_s = number, now_s
            return True
        self._other = number
        return False

    def _is_other(self, number: int, last: int, now_s: float) -> bool:
        if now_s - self._taken_s > SILENT_S or self._writers() <= 1:
            return False
        lost = number - last - 1
        if not 0 <= lost <= MOST_LOST:
            return True
        return self._other is not None and 0 <= number - self._other - 1 < lost
