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

"""A temperature that died, and channels that lack readings, on simulated machines."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from support import in_turn

from flea_diag.configuration.component import make_pipeline
from flea_diag.configuration.stand import load_stand
from flea_diag.tools.evaluate.case_run import diagnose
from flea_diag.wire.records import AmbiguityGroup, ChannelTable, Scan
from flea_sim_driver.scenario.library import find_scenario
from flea_sim_driver.scenario.scenario_file import overridden
from flea_sim_driver.stand import SimulatedStand

ONSET_S = 8.0


def groups(machine: str, spoil) -> list[AmbiguityGroup]:
    """Of 26 s of healthy running of a unit of the calibration, with readings that are spoilt."""
    drawn = overridden(
        find_scenario("nominal", machine), "nominal", {"duration_s": 26.0, "unit_seed": 201}
    )
    records = list(SimulatedStand(drawn))
    scans = [record for record in records if isinstance(record, Scan)]
    values = np.array([scan.values for scan in scans])
    times_s = np.array([scan.stamp_ns - scans[0].stamp_ns for scan in scans]) / 1e9
    spoil(values, times_s, scans[0].channels)
    told = [record for record in records if isinstance(record, ChannelTable)]
    told += [replace(s, values=tuple(row)) for s, row in zip(scans, values.tolist(), strict=True)]
    pipeline = make_pipeline(load_stand(machine), observer_backend="numpy")
    kept = diagnose(told, pipeline).kept
    return [record for record in kept if isinstance(record, AmbiguityGroup)]


@pytest.mark.slow
@pytest.mark.parametrize("machine", in_turn(["axis", "joint", "shoulder"], 3))
@pytest.mark.parametrize("zero", [True, False])
def test_a_slow_temperature_that_is_held_or_reads_zero_is_dead(machine: str, zero: bool) -> None:
    def dies(values, times_s, channels) -> None:
        column = channels.index("motor_temperature")
        dead = times_s >= ONSET_S
        values[dead, column] = 0.0 if zero else values[dead, column][0]

    last = groups(machine, dies)[-1]
    assert [member.fault for member in last.members] == ["motor_temperature_dead"]


@pytest.mark.slow
@pytest.mark.parametrize("machine", in_turn(["axis", "joint", "wing"], 3))
@pytest.mark.parametrize("share", [0.03, 0.3, None])
def test_channels_that_lack_readings_raise_no_alarm(machine: str, share: float | None) -> None:
    def lose(values, times_s, channels) -> None:
        if share is None:
            values[1::2, channels.index("actuator_position")] = math.nan
        else:
            values[np.random.default_rng(7200).random(values.shape) < share] = math.nan

    assert not any(group.members for group in groups(machine, lose))
