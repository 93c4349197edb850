"""Readings that are held, of channels that have no noise of their own.

What a voltage scatters by is the drive's doing, so noise, jumps and drop-outs of such a channel say
nothing of its sensor. But a reading that healthy recordings never hold for long, and that stays the
same to the last bit, is no measurement.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from flea_diag.core.sensors.reading_guard import stuck_scans
from flea_diag.core.sensors.sensor_limits import HELD, SensorLimit

Array = npt.NDArray[np.float64]


class HeldReadings:
    """Equal readings in a row of each channel of ``HELD`` that has a limit.

    Parameters
    ----------
    limits, channels, names, period_s : as of ``SensorTests``
    """

    def __init__(
        self,
        limits: Sequence[SensorLimit],
        channels: Sequence[str],
        names: Sequence[str],
        period_s: float,
    ) -> None:
        tested = [
            limit
            for limit in limits
            if limit.channel in HELD and limit.channel in channels and limit.repeats
        ]
        self._columns = [channels.index(limit.channel) for limit in tested]
        self.places = [names.index(f"{limit.channel}_stuck") for limit in tested]
        """Columns of the tests."""
        self.k = np.array([float(stuck_scans(limit, period_s)) for limit in tested])
        """Their limits, shape (tests,)."""
        self._last = np.full((1, len(tested)), np.nan)
        self._run = np.zeros((1, len(tested)))

    def interrupt(self) -> None:
        """A gap in the stream: no run of equal readings spans it."""
        self._last[:], self._run[:] = np.nan, 0.0

    def step(self, rows: Array) -> Array:
        """Equal readings before each of n rows, shape (n, tests); rows of shape (n, channels)."""
        now = rows[:, self._columns]
        same = now == np.concatenate((self._last, now[:-1]))
        scans = np.arange(1.0, len(now) + 1.0)[:, None]
        broken = np.maximum.accumulate(np.where(same, -self._run, scans))
        self._last, run = now[-1:], scans - broken
        self._run = run[-1:]
        return run
