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

"""Nominal recordings that alone keep a sensor from being tested for held readings.

A sensor that died in one recording stands still there for longer than any healthy one, and what
nominal recordings show is never called: with that recording the test of the channel is lost.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
import numpy.typing as npt

from flea_diag.core.sensors.sensor_limits import SensorLimit, sensor_limits
from flea_diag.core.sensors.sensor_set import SensorSet

Array = npt.NDArray[np.float64]


def held_alone(
    runs: Sequence[Mapping[str, Array]],
    limits: Sequence[SensorLimit],
    sensors: SensorSet,
    false_alarms_per_hour: float,
    period_s: float,
) -> tuple[tuple[int, str], ...]:
    """Numbers of such recordings, each with the channel that the others would have tested.

    ``runs`` and ``limits`` are those of ``sensor_limits``.
    """
    lost = {limit.channel for limit in limits if not limit.repeats}
    found = []
    for number in range(len(runs)) if lost else ():
        others = [run for k, run in enumerate(runs) if k != number]
        for limit in sensor_limits(others, sensors, false_alarms_per_hour, period_s):
            if limit.repeats and limit.channel in lost:
                found.append((number, limit.channel))
    return tuple(found)
