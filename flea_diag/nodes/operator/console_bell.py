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
