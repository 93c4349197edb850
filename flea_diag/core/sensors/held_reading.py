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

from flea_diag.core.flag_runs import in_a_row
from flea_diag.core.flat_state import Flat, FlatState
from flea_diag.core.sensors.reading_guard import stuck_scans
from flea_diag.core.sensors.sensor_limits import SensorLimit
from flea_diag.core.sensors.sensor_set import SensorSet

Array = npt.NDArray[np.float64]
Counts = npt.NDArray[np.int64]


class HeldReadings:
    """Changes of its command since each channel of ``SensorSet.held`` that has a limit changed.

    Where there is no command, readings that are held are withheld.

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
        held = set(sensors.held) & set(channels)
        known = [limit for limit in limits if limit.repeats and limit.channel in held]
        commands = [sensors.held[limit.channel] for limit in known]
        self._columns = [
            (
                channels.index(limit.channel),
                channels.index(command) if command in channels else None,
            )
            for limit, command in zip(known, commands, strict=True)
        ]
        self._least = [limit.repeats for limit in known]
        tested = [limit for limit, c in zip(known, commands, strict=True) if c in channels]
        self.places = [sensors.names.index(f"{limit.channel}_stuck") for limit in tested]
        """Columns of the tests."""
        self.k = np.array([float(stuck_scans(limit, period_s)) for limit in tested])
        """Their limits, shape (tests,)."""
        of_tests = iter(self.places)
        self._state = FlatState(
            {"last": np.full((len(known), 2), math.nan)},
            {
                "columns": [column for column, _ in self._columns],
                "commands": [-1 if c is None else c for _, c in self._columns],
                "places": [-1 if c is None else next(of_tests) for _, c in self._columns],
                "least": self._least,
                "runs": np.zeros((len(known), 2)),
            },
        )

    @property
    def tables(self) -> Flat:
        """What ``held_loops`` takes."""
        return self._state.flat

    def interrupt(self) -> None:
        """A gap in the stream: no run of equal readings spans it."""
        self._state.table["last"][:], self._state.table["runs"][:] = math.nan, 0

    def step(self, rows: Array, usable: Array, z: Array) -> bool:
        """Fill in the number at each of n rows in its columns of ``z``; rows (n, channels).

        What is held without a command becomes NaN in ``usable``, shape (n, channels); whether any.
        """
        places, any_withheld = iter(self.places), False
        for channel, (column, command) in enumerate(self._columns):
            asked = np.full(len(rows), math.nan) if command is None else rows[:, command]
            runs, lone = self._in_a_row(channel, rows[:, column], asked)
            missing = lone >= self._least[channel]
            if missing.any():
                usable[missing, column], any_withheld = math.nan, True
            if command is not None:
                z[:, next(places)] = runs
        return any_withheld

    def _in_a_row(self, channel: int, values: Array, asked: Array) -> tuple[Counts, Counts]:
        """Of n scans at once: for how many each reading is held against the command, and alone."""
        state = self._state.table
        held, before = state["last"][channel].tolist()
        run, alone = state["runs"][channel].tolist()
        known = ~np.isnan(values)
        value, asks = values[known], asked[known]
        same, silent = value == np.append(held, value[:-1]), np.isnan(asks)
        # A command that is missing is as it was.
        told = np.maximum.accumulate(np.where(silent, 0, np.arange(1, 1 + len(asks))))
        command = np.append(before, asks)[told]
        moved = np.abs(asks - np.append(before, command[:-1])) > 0.0
        runs = np.append(run, in_a_row(same & moved, ~same, run))
        lone = np.append(alone, in_a_row(same & silent, ~(same & silent), alone))
        if len(value):
            state["last"][channel] = value[-1], command[-1]
            state["runs"][channel] = runs[-1], lone[-1]
        upto = np.cumsum(known)
        return runs[upto], lone[upto]
