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

"""Machines that are not the FLEA: simulated by their files, diagnosed by their own descriptions."""

from __future__ import annotations

import pytest
from support import in_turn

from flea_diag.configuration.component import make_pipeline
from flea_diag.configuration.stand import load_stand
from flea_diag.tools.evaluate.case_run import diagnose
from flea_diag.wire.records import AmbiguityGroup, Outcome
from flea_sim_driver.scenario.library import find_scenario
from flea_sim_driver.scenario.scenario_file import overridden
from flea_sim_driver.stand import SimulatedStand


@pytest.mark.parametrize(
    ("machine", "fault", "fellow"),
    in_turn(
        [
            ("ema", "magnet_loss", "winding_short"),
            ("joint", "gear_friction", "jam"),
            ("wing", "winding_resistance_rise", "winding_short"),
            ("axis", "gear_friction", "jam"),
            ("shoulder", "gear_friction", "jam"),
        ],
        2,
    ),
)
def test_a_fault_of_another_machine_is_found_by_its_description(
    machine: str, fault: str, fellow: str
) -> None:
    """On a unit of the calibration (201), 12 s of healthy running before the fault."""
    drawn = overridden(find_scenario(fault, machine), fault, {"duration_s": 26.0, "unit_seed": 201})
    # numpy, for to compile the relations of a stand takes longer than one run of it.
    pipeline = make_pipeline(load_stand(machine), observer_backend="numpy")
    kept = diagnose(SimulatedStand(drawn), pipeline).kept
    groups = [record for record in kept if isinstance(record, AmbiguityGroup)]
    onset_ns = round((drawn.run.start_s + drawn.faults[0].onset_s) * 1e9)
    last = groups[-1]
    assert last.detected_stamp_ns > onset_ns
    assert {member.fault for member in last.members} <= {fault, fellow}
    assert fault in {member.fault for member in last.members}
    assert last.outcome in (Outcome.ISOLATED, Outcome.INDISTINGUISHABLE)
