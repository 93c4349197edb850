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

"""Location of the scenarios shipped with the package: the source tree or the prefix.

Those of a machine other than the default one lie in a folder of its name.
"""

from __future__ import annotations

import os
from pathlib import Path

from flea_diag.errors import ConfigurationError, shown
from flea_sim_driver.machine.library import (
    DEFAULT_MACHINE,
    SUFFIXES,
    config_folders,
    find_machine,
)
from flea_sim_driver.scenario.flight_profiles import is_profile
from flea_sim_driver.scenario.flights import flight_scenario
from flea_sim_driver.scenario.scenario import Scenario
from flea_sim_driver.scenario.scenario_file import load_scenario, machine_path


def _folder(machine: str) -> str:
    own = "" if machine in ("", DEFAULT_MACHINE) else machine
    return f"scenarios/{own}" if is_name(own) else "scenarios"


def is_name(machine: str) -> bool:
    """Whether this names a shipped machine rather than a file."""
    return bool(machine) and os.sep not in machine and Path(machine).suffix not in SUFFIXES


def scenario_names(machine: str = "") -> tuple[str, ...]:
    """Names of the scenarios of a machine shipped with the package."""
    for folder in config_folders(_folder(machine)):
        if folder.is_dir():
            return tuple(sorted(path.stem for path in folder.glob("*.yaml")))
    return ()


def find_scenario(name_or_path: str, machine: str = "") -> Scenario:
    """Scenario from a file, or by name from those shipped with the package.

    Parameters
    ----------
    name_or_path
        Of the scenario.
    machine
        Replaces that of the scenario if it is given; a name is then that of its own scenario.

    A flight profile is a scenario by its name, on any machine.

    Raises
    ------
    ConfigurationError
        No such file or name, or its content is refused.
    """
    path = Path(name_or_path)
    if path.suffix in SUFFIXES:
        return load_scenario(path, machine)
    for folder in config_folders(_folder(machine)):
        candidate = folder / f"{name_or_path}.yaml"
        if candidate.is_file() and candidate.parent == folder:
            return load_scenario(candidate, machine)
    if path.is_file():
        return load_scenario(path, machine)
    if is_profile(name_or_path):
        return flight_scenario(name_or_path, machine=machine_path(machine or DEFAULT_MACHINE))
    if machine:
        find_machine(machine)  # without the machine no scenario is to blame
    named = ", ".join(scenario_names(machine)) or "the installed ones (none found)"
    raise ConfigurationError(
        f"scenario {shown(name_or_path)} is neither a YAML file, nor a flight profile of --list, "
        f"nor one of {named}"
    )
