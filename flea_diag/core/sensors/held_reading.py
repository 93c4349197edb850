"""Readings that are held, of channels that have no noise of their own.

What a voltage scatters by is the drive's doing, so noise, jumps and drop-outs of such a channel say
nothing of its sensor. But a reading that healthy recordings never hold for long, and that stays the
same to the last bit while its command changes, is no measurement. Without a command nothing says
that it should have changed.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from flea_diag.core.sensors.reading_guard import stuck_scans
from flea_diag.core.sensors.sensor_limits import SensorLimit
from flea_diag.core.sensors.sensor_set import SensorSet

Array = npt.NDArray[np.float64]


class HeldReadings:
    """Changes of its command since each channel of ``SensorSet.held`` that has a limit changed.

    Parameters
    ----------
    limits, channels, sensors, period_s : as of ``SensorTests``
    """

    def __init__(
        self,
        limits: Sequence[SensorLimit],
        channels: Sequence[str],
        sensors: SensorSet,
        period_s: float,
    ) -> None:
        tested = [
            limit
            for limit in limits
            if limit.repeats and {limit.channel, sensors.held.get(limit.channel)} <= set(channels)
        ]
        self._columns = [
            (channels.index(limit.channel), channels.index(sensors.held[limit.channel]))
            for limit in tested
        ]
        self.places = [sensors.names.index(f"{limit.channel}_stuck") for limit in tested]
        """Columns of the tests."""
        self.k = np.array([float(stuck_scans(limit, period_s)) for limit in tested])
        """Their limits, shape (tests,)."""
        self.interrupt()

    def interrupt(self) -> None:
        """A gap in the stream: no run of equal readings spans it."""
        self._last = [(math.nan, math.nan, 0)] * len(self._columns)

    def step(self, rows: Array) -> Array:
        """The number at each of n rows, shape (n, tests); rows of shape (n, channels)."""
        runs = np.empty((len(rows), len(self._columns)))
        for test, (column, command) in enumerate(self._columns):
            held, before, run = self._last[test]
            told = []
            # Plain numbers: one scan costs less than one call of numpy.
            for value, asked in zip(*rows[:, (column, command)].T.tolist(), strict=True):
                run = run + (abs(asked - before) > 0.0) if value == held else 0
                held, before = value, asked
                told.append(run)
            runs[:, test], self._last[test] = told, (held, before, run)
        return runs
