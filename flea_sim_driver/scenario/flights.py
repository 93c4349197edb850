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

"""A healthy scenario of each flight profile; ``find_scenario`` knows them by name."""

from __future__ import annotations

from typing import Any

from flea_sim_driver.scenario.flight_profiles import DURATION_S, FLIGHT_PROFILES
from flea_sim_driver.scenario.scenario import Scenario
from flea_sim_driver.scenario.scenario_file import scenario_from_mapping


def flights(seed: int) -> tuple[Scenario, ...]:
    """All profiles on the FLEA with this seed."""
    return tuple(flight_scenario(row.name, seed) for row in FLIGHT_PROFILES)


def flight_scenario(profile: str, seed: int = 1, **values: Any) -> Scenario:
    """One profile; ``values`` are further keys of a scenario."""
    content = {
        "name": profile, "seed": seed, "duration_s": DURATION_S,
        "motion": {"kind": "flight", "profile": profile}, **values,
    }  # fmt: skip
    return scenario_from_mapping(content, f"flight profile {profile}")
