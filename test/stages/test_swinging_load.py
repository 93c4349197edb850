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

"""A load that turns from one side to the other within the range of a calibration."""

from __future__ import annotations

from typing import Any

import pytest
from support.stand_runs import fault

from flea_diag.configuration.component import make_pipeline
from flea_diag.configuration.stand import load_stand
from flea_diag.tools.evaluate.case_run import CaseDiagnosis, diagnose
from flea_diag.wire.records import AmbiguityGroup, Detection
from flea_sim_driver.scenario.scenario_file import scenario_from_mapping
from flea_sim_driver.stand import SimulatedStand

pytestmark = pytest.mark.slow


def diagnosed(**more: Any) -> CaseDiagnosis:
    """Twelve seconds of the 8 kN actuator, whose calibration has constant loads."""
    values = {
        "machine": "ema",
        "motion": {"kind": "sine", "amplitude_m": 0.021, "frequency_hz": 0.34, "centre_m": 0.062},
        "load": {"constant_n": 400.0, "amplitude_n": 5500.0, "frequency_hz": 0.096},
        "duration_s": 12.0,
        "seed": 1,
        "sensors": {"vibration": False},
    }
    stand = SimulatedStand(scenario_from_mapping({**values, **more}, "swing"))
    # numpy, for to compile the relations of a stand takes longer than one run of it.
    return diagnose(list(stand), make_pipeline(load_stand("ema"), observer_backend="numpy"))


def test_what_a_drive_drops_under_its_current_is_no_shift_of_its_gain() -> None:
    """Its level was 0.48 V lower 5 s earlier, at 5.9 kN on the other side."""
    assert not [record for record in diagnosed().kept if isinstance(record, Detection)]


@pytest.mark.parametrize(
    ("name", "size"), [("motor_voltage_bias", 2.5), ("load_force_bias", 1200.0)]
)
def test_a_sensor_fault_shows_in_spite_of_the_swing(name: str, size: float) -> None:
    done = diagnosed(**fault(name, 8.0, size=size))
    (opened, *_) = [record for record in done.kept if isinstance(record, Detection)]
    assert opened.stamp_ns - done.start_ns > 8.0e9
    last = [record for record in done.kept if isinstance(record, AmbiguityGroup)][-1]
    assert name in [member.fault for member in last.members]
