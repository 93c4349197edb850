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

"""A fault of the simulated stand that goes away: its episode closes, and nothing follows it."""

from __future__ import annotations

import pytest

from flea_diag.configuration.component import make_pipeline
from flea_diag.configuration.stand import load_stand
from flea_diag.tools.evaluate.case_run import in_blocks
from flea_diag.wire.blocks import ScanBlock
from flea_diag.wire.records import AmbiguityGroup, Detection, Outcome
from flea_sim_driver.scenario.scenario_file import scenario_from_mapping
from flea_sim_driver.stand import SimulatedStand

pytestmark = pytest.mark.slow

ONSET_S, CLEARED_S, DURATION_S = 15.0, 25.0, 70.0


def told(fault: str, seed: int) -> list[Detection | AmbiguityGroup]:
    """Episodes and verdicts of a run with a fault for ten seconds."""
    values = {
        "motion": {"kind": "sine", "amplitude_m": 0.018, "frequency_hz": 0.5, "centre_m": 0.045},
        "load": {"constant_n": 20.0, "amplitude_n": 80.0, "frequency_hz": 0.2},
        "duration_s": DURATION_S,
        "seed": seed,
        "sensors": {"vibration": False},
    }
    stand = SimulatedStand(scenario_from_mapping(values, "passing"))
    records = []
    while not stand.finished:
        if abs(stand.time_s - ONSET_S) < 0.05:
            stand.inject(fault)
        elif abs(stand.time_s - CLEARED_S) < 0.05:
            stand.clear()
        records += stand.advance()
    pipeline, said = make_pipeline(load_stand(), rearm_after_s=8.0), []
    for record in in_blocks(records):
        by_block = isinstance(record, ScanBlock)
        said += pipeline.handle_block(record) if by_block else pipeline.handle(record)
    said += pipeline.finish()
    return [record for record in said if isinstance(record, Detection | AmbiguityGroup)]


@pytest.mark.parametrize("fault", ["jam", "motor_current_bias"])
def test_one_episode_and_then_all_is_quiet(fault: str) -> None:
    """The filter that was frozen meanwhile is far off; the one that begins anew must not be."""
    said = told(fault, seed=1)
    detections = [record for record in said if isinstance(record, Detection)]
    assert [record.detected for record in detections] == [True, False]
    after = [record for record in said if record.stamp_ns >= detections[1].stamp_ns]
    outcomes = {record.outcome for record in after if isinstance(record, AmbiguityGroup)}
    assert outcomes == {Outcome.NOMINAL}
