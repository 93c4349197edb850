"""Readings that are held, of channels that have no noise of their own.

What a voltage scatters by is the drive's doing, so noise, jumps and drop-outs of such a channel say
nothing of its sensor. But a reading that healthy recordings never hold for long, and that stays the
same to the last bit while its command changes, is no measurement. Without a command nothing says
that it should have changed.
"""

from __future__ import annotations

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
        self._columns = [channels.index(limit.channel) for limit in tested]
        self.places = [sensors.names.index(f"{limit.channel}_stuck") for limit in tested]
        """Columns of the tests."""
        self.k = np.array([float(stuck_scans(limit, period_s)) for limit in tested])
        """Their limits, shape (tests,)."""
        self._commands = [channels.index(sensors.held[limit.channel]) for limit in tested]
        self._last = np.full((1, 2 * len(tested)), np.nan)
        self._run = np.zeros((1, len(tested)))

    def interrupt(self) -> None:
        """A gap in the stream: no run of equal readings spans it."""
        self._last[:], self._run[:] = np.nan, 0.0

    def step(self, rows: Array) -> Array:
        """The number at each of n rows, shape (n, tests); rows of shape (n, channels)."""
        now = rows[:, [*self._columns, *self._commands]]
        change = now - np.concatenate((self._last, now[:-1]))
        self._last = now[-1:]
        held, asked = np.split(change, 2, axis=1)
        same = held == 0.0
        count = np.cumsum(same & (np.abs(asked) > 0.0), axis=0)
        run = count - np.maximum.accumulate(np.where(same, -self._run, count))
        self._run = run[-1:]
        return np.asarray(run)
