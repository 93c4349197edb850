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

"""Instruments that are read more seldom than scans are made, as a robot's temperatures are."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from flea_sim_driver.machine.machine import Machine

Array = npt.NDArray[np.float64]


class SlowReadings:
    """Holds each reading of a slow instrument until its next one.

    Parameters
    ----------
    machine
        Whose instruments they are; those without a rate of their own are read in every scan.
    """

    def __init__(self, machine: Machine) -> None:
        rate_hz = machine.sampling.scan_rate_hz
        self._every = {
            place: round(rate_hz / row.rate_hz)
            for place, row in enumerate(machine.instruments)
            if row.rate_hz
        }
        self._last: dict[int, float] = {}
        self._scan = 0

    def hold(self, values: Array) -> None:
        """Replace what was not read in a block, shape (scans, channels), by the last reading."""
        scans = np.arange(len(values))
        for place, every in self._every.items():
            # Place of the latest reading of this block in each scan; negative: of one before it.
            latest = scans - (self._scan + scans) % every
            before = latest < 0
            held = values[np.maximum(latest, 0), place]
            held[before] = self._last.get(place, 0.0)
            values[:, place] = held
            self._last[place] = float(held[-1])
        self._scan += len(values)
