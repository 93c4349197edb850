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

"""What the tests of the simulated stand share: short runs and their signals."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import numpy.typing as npt

from flea_diag.configuration.component import make_pipeline
from flea_diag.configuration.stand import load_stand
from flea_diag.wire.records import AmbiguityGroup, Record, Scan, Truth, VibrationBlock
from flea_sim_driver.scenario.library import find_scenario
from flea_sim_driver.scenario.scenario import Scenario
from flea_sim_driver.scenario.scenario_file import scenario_from_mapping
from flea_sim_driver.scenario.settings import FaultSetting
from flea_sim_driver.stand import SimulatedStand
from support import stands

Array = npt.NDArray[np.float64]
SINE = {"kind": "sine", "amplitude_m": 0.018, "frequency_hz": 0.5, "centre_m": 0.045}
SLOW = {"vibration": False}


def scenario(**values: Any) -> Scenario:
    """A scenario of these values, 10 s of a sine without vibration where nothing else is said."""
    return scenario_from_mapping(
        {"motion": SINE, "sensors": SLOW, "duration_s": 10.0, **values}, "test"
    )


def records(**values: Any) -> list[Record]:
    """Everything that a stand delivers."""
    return list(SimulatedStand(scenario(**values)))


def last_verdict(stand: str = "", **values: Any) -> AmbiguityGroup:
    """What is said in the end of a run of these values, on a stand of this name."""
    pipeline = make_pipeline(load_stand(stand))
    sent = [record for record in records(**values) if not isinstance(record, Truth)]
    return stands.verdict((*stands.said_in_blocks(pipeline, sent), *pipeline.finish()))


def diagnosed(
    machine: str, seed: int, motion: str, *faults: FaultSetting, lasts_s: float = 44.0
) -> AmbiguityGroup:
    """The last verdict on a run of a machine in one of its own scenarios."""
    found = find_scenario(motion, machine)
    run = replace(found.run, seed=seed, duration_s=lasts_s)
    sensors = replace(found.sensors, vibration=False)
    stand = SimulatedStand(replace(found, run=run, sensors=sensors, faults=faults))
    sent = [record for record in stand if not isinstance(record, Truth)]
    pipeline = make_pipeline(load_stand(machine))
    return stands.verdict((*stands.said_in_blocks(pipeline, sent), *pipeline.finish()))


def scans(run: list[Record]) -> dict[str, Array]:
    """Channels over time, shape (scans,) each."""
    rows = [record for record in run if isinstance(record, Scan)]
    table = np.array([row.values for row in rows])
    return {name: table[:, column] for column, name in enumerate(rows[0].channels)}


def vibration(run: list[Record]) -> Array:
    """Acceleration of all six axes, shape (samples, 6)."""
    return np.vstack([r.points()[1] for r in run if isinstance(r, VibrationBlock)])


def fault(name: str, onset_s: float = 5.0, **options: Any) -> dict[str, Any]:
    """Scenario entry with one fault."""
    return {"faults": [{"fault": name, "onset_s": onset_s, **options}]}
