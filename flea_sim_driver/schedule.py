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

"""Time course of each fault: onset, growth, intermittence, clearing."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from flea_sim_driver.faults import FaultRow, catalogue
from flea_sim_driver.scenario.scenario import Scenario
from flea_sim_driver.scenario.settings import FaultSetting

GAP_S = 0.05


@dataclass(frozen=True)
class FaultCourse:
    """Time course of one fault, active from ``onset_s`` to ``end_s`` after the start of the run."""

    setting: FaultSetting
    row: FaultRow
    onset_s: float
    end_s: float = float("inf")
    seed: int = 0

    def size_at(self, time_s: float, unit: str) -> float | None:
        """Size at a time on a unit, None while it is absent."""
        if not self.onset_s <= time_s < self.end_s or self.setting.unit not in ("", unit):
            return None
        age = time_s - self.onset_s
        if self.setting.on_s > 0.0 and not self._is_on(age + 1e-9):
            return None
        return self._grown(age)

    def _is_on(self, age: float) -> bool:
        """Whether an intermittent fault is present so long after its onset."""
        on_s, off_s, irregular = self.setting.on_s, self.setting.off_s, self.setting.irregular
        cycle = on_s + off_s
        number, since = divmod(age, cycle)
        if number < 1.0 or not irregular:
            return since < on_s
        # It comes once in each cycle, at random within the middle of it.
        return 0.0 <= since - self._late_s(int(number), irregular * off_s) < on_s

    def _late_s(self, number: int, most_s: float) -> float:
        """By how much it comes later in this cycle; the same whenever it is asked."""
        seed = (self.seed, number, round(self.onset_s * 1e3))
        return float(np.random.default_rng(seed).uniform(0.0, most_s))

    def in_gap(self, rate_hz: float, time_s: float) -> bool:
        """Whether a drop-out of 50 ms is active; loop and DAQ lose the same samples."""
        slot = int((time_s - self.onset_s + 1e-9) / GAP_S)
        seed = (self.seed, slot, round(self.onset_s * 1e3))
        return bool(np.random.default_rng(seed).random() < GAP_S * rate_hz)

    def _grown(self, age: float) -> float:
        if self.setting.growth_s <= 0.0 or age >= self.setting.growth_s:
            return self.setting.size
        rest = 1.0 if self.row.mode == "scaling" else 0.0
        return rest + (self.setting.size - rest) * age / self.setting.growth_s


def on_grid(time_s: float, scan_s: float) -> float:
    """The scan instant nearest to a time: the truth is exact then and no scan is mixed."""
    return round(time_s / scan_s) * scan_s


def courses(scenario: Scenario) -> tuple[FaultCourse, ...]:
    """Fault courses of a scenario; a fault of a unit switched in later begins at the switch."""
    return tuple(_course(setting, scenario) for setting in scenario.faults)


def _course(setting: FaultSetting, scenario: Scenario) -> FaultCourse:
    onset, switch, run = setting.onset_s, scenario.switch, scenario.run
    if (
        setting.unit not in ("", run.active_unit)
        and switch.at_s >= 0.0
        and setting.unit == switch.to
    ):
        onset = max(onset, switch.at_s)
    row = catalogue(scenario.machine)[setting.fault]
    scan_s = scenario.machine.sampling.scan_s
    return FaultCourse(setting, row, on_grid(onset, scan_s), seed=run.seed)


def cleared(course: FaultCourse, time_s: float) -> FaultCourse:
    """The course, ended at ``time_s`` unless it has ended before."""
    return replace(course, end_s=min(course.end_s, time_s))
