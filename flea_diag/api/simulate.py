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

"""``fd.simulate``: a run of the simulated stand, in memory."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from flea_diag.api.recording import Recording, kept


def simulate(
    scenario: str | Path = "nominal",
    *,
    machine: str = "",
    seed: int | None = None,
    unit_seed: int | None = None,
    duration_s: float | None = None,
    fault: str = "",
    onset_s: float = 10.0,
    size: float | None = None,
    vibration: bool = False,
) -> Recording:
    """Simulate one run; the truth comes with it and is never shown to the diagnosis.

    Parameters
    ----------
    scenario
        Name of a shipped scenario (``jam``; ``flea simulate --list`` has all), or a YAML file.
    machine
        Name of a shipped machine or a file; empty: that of the scenario.
    seed, unit_seed
        Of all noise and of the unit; None: those of the scenario, and of ``seed``.
    duration_s
        Length in s.
    fault, onset_s, size
        Fault to add, its onset in s and its size in the unit of its catalogue.
    vibration
        Whether to sample the accelerometers, at tens of megabytes a minute.

    Returns
    -------
    Recording
        Channels in SI, with ``truth``.

    Raises
    ------
    ConfigurationError
        Unknown scenario, machine or fault, or a value outside its limits.
    """
    from flea_diag.tools.stand.simulate import given
    from flea_sim_driver.scenario.library import find_scenario
    from flea_sim_driver.scenario.scenario_file import overridden
    from flea_sim_driver.stand import SimulatedStand

    found = find_scenario(str(scenario), machine)
    found = replace(found, sensors=replace(found.sensors, vibration=vibration))
    run = given(seed=seed, unit_seed=unit_seed, duration_s=duration_s)
    added = {"fault": fault, "onset_s": onset_s, **given(size=size)} if fault else None
    made = overridden(found, "simulate", run, added)
    return kept(f"{made.run.name}_{made.run.seed}", iter(SimulatedStand(made)))
