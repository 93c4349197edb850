"""Levels of vibration meet the motion of their time, and the monitor judges them.

A block of vibration is here at once, the smoothed speed of the same time half a kernel later. So
it waits for that; one for which none comes is of a time at which the observer was away.
"""

from __future__ import annotations

from collections import deque

from flea_diag.core.vibration.nominal_range import NominalRanges
from flea_diag.core.vibration.vibration_monitor import VibrationAlarm, VibrationMonitor
from flea_diag.wire.records import VibrationLevel

LEVEL_DELAY_NS = 150_000_000
"""From the end of a block until the smoothed speed of that time is known: half a kernel."""
LATEST_NS = 2 * LEVEL_DELAY_NS
"""A block that waits longer is of a time from which no speed came."""


class VibrationWatch:
    """The monitor of one stand, and the levels that still wait for their motion.

    Attributes
    ----------
    monitor
        To be told of speed and load, scan by scan.
    """

    def __init__(self, nominal: NominalRanges) -> None:
        self.monitor = VibrationMonitor(nominal)
        self._levels: deque[VibrationLevel] = deque(maxlen=100)

    def add(self, level: VibrationLevel) -> None:
        """One more block."""
        self._levels.append(level)

    @property
    def waits(self) -> bool:
        """Whether a block waits for its motion."""
        return bool(self._levels)

    def alarm(self, stamp_ns: int) -> VibrationAlarm | None:
        """The alarm that the block raises whose motion is known with this scan, or None."""
        if not self._levels or self._levels[0].stamp_ns + LEVEL_DELAY_NS > stamp_ns:
            return None
        level = self._levels.popleft()
        if stamp_ns - level.stamp_ns > LATEST_NS:
            return None
        return self.monitor.step(level.axes, level.std, level.kurtosis)
