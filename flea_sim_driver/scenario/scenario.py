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

"""A scenario: motion, load, faults and conditions of one run."""

from __future__ import annotations

from dataclasses import asdict, dataclass, field
from hashlib import sha256
from typing import Any

from flea_sim_driver.machine.machine import Machine
from flea_sim_driver.plant.structure import StructureSpread
from flea_sim_driver.scenario.flight import Flight
from flea_sim_driver.scenario.settings import (
    Brake,
    FaultSetting,
    HardStops,
    Load,
    Motion,
    RunSettings,
    Sensors,
    Switch,
)


@dataclass(frozen=True)
class Scenario:
    """Motion, load, faults and conditions of one run."""

    machine: Machine
    run: RunSettings
    motion: Motion
    load: Load
    travel: HardStops
    sensors: Sensors
    switch: Switch
    spread: Any
    """Relative standard deviation of each parameter in which units of the machine differ."""
    structure: StructureSpread
    brake: Brake = field(default_factory=Brake)
    faults: tuple[FaultSetting, ...] = ()
    flight: Flight | None = None

    def unit_at(self, time_s: float) -> str:
        """The test actuator in use at a time."""
        switched = 0.0 <= self.switch.at_s <= time_s + 1e-9
        return self.switch.to if switched else self.run.active_unit

    def serial(self, unit: str) -> str:
        """Serial number of a test actuator; the same physical unit has the same in every run.

        A unit is what its seed and the spread draw.
        """
        run = self.run
        if run.serial and unit == run.active_unit:
            return run.serial
        seed = run.seed if run.unit_seed < 0 else run.unit_seed
        drawn = (seed, unit, run.unit_spread, sorted(asdict(self.spread).items()))
        return f"SIM-{sha256(repr(drawn).encode()).hexdigest()[:8].upper()}"
