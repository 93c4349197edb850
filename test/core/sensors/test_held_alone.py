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

"""A sensor that died in one nominal recording: the others show that it did."""

from __future__ import annotations

import numpy as np
import pytest

from flea_diag.core.sensors.held_alone import held_alone
from flea_diag.core.sensors.sensor_limits import sensor_limits
from flea_diag.core.sensors.sensor_set import SensorSet

SENSORS = SensorSet({"load_force": 0.1, "motor_current": 1e-3}, {})
RATE_PER_HOUR, PERIOD_S = 0.1, 0.01


def recordings(dead: tuple[int, ...]) -> list[dict[str, np.ndarray]]:
    """Six of noise; the current stands still from half way in these."""
    draw = np.random.default_rng(3)
    found = [{name: draw.standard_normal(2000) for name in SENSORS.resolutions} for _ in range(6)]
    for number in dead:
        found[number]["motor_current"][1000:] = 0.0
    return found


@pytest.mark.parametrize(
    ("dead", "named"),
    [((), ()), ((2,), ((2, "motor_current"),)), ((2, 4), ())],
    ids=["none", "one", "two, of which none is alone"],
)
def test_the_recording_that_alone_shows_a_held_reading_is_named(dead, named):
    runs = recordings(dead)
    limits = sensor_limits(runs, SENSORS, RATE_PER_HOUR, PERIOD_S)
    assert {limit.channel: limit.repeats > 0 for limit in limits} == {
        "load_force": True,
        "motor_current": not dead,
    }
    assert held_alone(runs, limits, SENSORS, RATE_PER_HOUR, PERIOD_S) == named
