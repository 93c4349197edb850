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

"""Runs of minutes: a motor that warms is no fault, and a verdict on one fault stays what it is."""

from __future__ import annotations

import pytest
from support import stands
from support.stand_runs import diagnosed

from flea_diag.wire.records import Outcome
from flea_sim_driver.scenario.settings import FaultSetting

SURROUNDINGS = FaultSetting("ambient_temperature_dead", 12.0, 0.0)
LEAVES = FaultSetting("nut_temperature_drift", 12.0, -1.42)


@pytest.mark.in_turn(2)
@pytest.mark.slow
def test_a_magnet_that_weakens_as_its_motor_warms_is_no_fault() -> None:
    """Calibrated up to 29 degC; here it is 45 degC warm when the run ends."""
    assert diagnosed("ema", 38018, "nominal_pulled", lasts_s=150.0).outcome is Outcome.NOMINAL


@pytest.mark.in_turn(2)
@pytest.mark.slow
@pytest.mark.parametrize(
    ("machine", "seed", "motion", "fault", "lasts_s"),
    [
        # The level of before is that of a cold winding.
        ("ema", 29009, "nominal_pulled", SURROUNDINGS, 150.0),
        # Its winding warms by itself from the detection on, and is 5 K off after a minute.
        ("ema", 29001, "nominal_pulled", FaultSetting("motor_voltage_dead", 12.0, 0.0), 100.0),
        # It leaves the range of its sensor after 80 s, and is refused.
        ("flea", 29020, "nominal_trapezoid", LEAVES, 105.0),
        # What its model lacks adds up: 50 nats for a second fault after 70 s.
        ("flea", 29030, "nominal_loaded", FaultSetting("nut_temperature_dead", 12.0, 0.0), 95.0),
    ],
)
def test_a_fault_stays_the_one_that_was_found(
    machine: str, seed: int, motion: str, fault: FaultSetting, lasts_s: float
) -> None:
    last = diagnosed(machine, seed, motion, fault, lasts_s=lasts_s)
    assert last.outcome is Outcome.ISOLATED
    assert stands.members(last) == {fault.fault}
