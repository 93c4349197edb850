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

"""Reads scenarios from YAML, checks them, and writes them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, fields, replace
from pathlib import Path
from typing import Any

from flea_diag.errors import ConfigurationError
from flea_diag.fields.reader import read_as
from flea_diag.fields.values import FINITE
from flea_diag.formats import migrated
from flea_diag.wire.parameters import build
from flea_diag.wire.regular_file import read_text
from flea_diag.wire.yaml_text import parse_yaml
from flea_sim_driver.machine.library import SUFFIXES, find_machine
from flea_sim_driver.machine.machine import Machine
from flea_sim_driver.scenario.feasibility import checked_scenario
from flea_sim_driver.scenario.flight import Flight, read_flight
from flea_sim_driver.scenario.flight_profiles import find_profile
from flea_sim_driver.scenario.scenario import Scenario
from flea_sim_driver.scenario.section import SECTIONS, SPREAD, section, section_class
from flea_sim_driver.scenario.settings import FaultSetting, Motion, RunSettings

FILE_LIMIT_BYTES = 1 << 20
NAMES = (*SECTIONS, SPREAD)
"""Sections of a scenario."""


def scenario_from_mapping(content: object, where: str, folder: Path = Path()) -> Scenario:
    """A checked scenario.

    Raises
    ------
    ConfigurationError
        Unknown key, wrong type, value out of its limits, or a run that the stand cannot follow.
    """
    values = migrated("scenario", content, where)
    plain = {k: v for k, v in values.items() if k not in NAMES and k != "faults"}
    machine, run = _machine(build(RunSettings, plain, where), folder)
    sections: dict[str, Any] = {
        name: section(name, machine, values.get(name, {}), f"{where}: {name}") for name in NAMES
    }
    settings = read_as(
        tuple[FaultSetting, ...], values.get("faults", []), f"{where}: faults", magnitudes=FINITE
    )
    flight = _flight(sections["motion"], run, machine, where, folder)
    return checked_scenario(
        Scenario(machine, run, faults=settings, flight=flight, **sections), where
    )


def _machine(run: RunSettings, folder: Path) -> tuple[Machine, RunSettings]:
    """The machine of a run; a file is one from the scenario's folder."""
    name = run.machine
    if Path(name).suffix in SUFFIXES:
        run = replace(run, machine=str((folder / name).absolute()))
    return find_machine(run.machine), run


def _flight(
    motion: Motion, run: RunSettings, machine: Machine, where: str, folder: Path = Path()
) -> Flight | None:
    if motion.kind != "flight":
        return None
    if motion.profile:
        return find_profile(motion.profile).flight(machine.limits, run.seed, run.duration_s)
    if not motion.file:
        raise ConfigurationError(
            f"{where}: motion.file and motion.profile are empty, a flight needs a CSV, a bag or a "
            "profile"
        )
    return read_flight(folder / motion.file, machine.limits, fit=motion.fit)


def overridden(
    scenario: Scenario,
    where: str,
    run: Mapping[str, Any],
    fault: Mapping[str, Any] | None = None,
) -> Scenario:
    """A checked scenario with changed settings and one additional fault.

    Parameters
    ----------
    run
        Fields of ``RunSettings`` to change.
    fault
        Fields of the ``FaultSetting`` to add.

    Raises
    ------
    ConfigurationError
        As for ``scenario_from_mapping``: the same limits apply.
    """
    plain = build(RunSettings, {**asdict(scenario.run), **run}, where)
    more = () if fault is None else (build(FaultSetting, fault, where),)
    changed = replace(scenario, run=plain, faults=(*scenario.faults, *more))
    if scenario.motion.profile:
        changed = replace(changed, flight=_flight(scenario.motion, plain, scenario.machine, where))
    return checked_scenario(changed, where)


def scenario_to_mapping(scenario: Scenario) -> dict[str, Any]:
    """Mapping from which ``scenario_from_mapping`` builds this scenario; omits defaults."""
    values = _changed(scenario.run)
    for name in NAMES:
        kind = section_class(name, scenario.machine)
        changed = _changed(getattr(scenario, name), kind)
        if changed:
            values[name] = changed
    if scenario.faults:
        values["faults"] = [_changed(row) for row in scenario.faults]
    return values


def _changed(values: Any, kind: type | None = None) -> dict[str, Any]:
    """Fields that differ from the defaults of a class, by default their own; no size is NaN."""
    return {
        entry.name: value
        for entry in fields(kind or values)
        for value in (getattr(values, entry.name),)
        if value != entry.default and value == value
    }


def load_scenario(path: Path, machine: str = "") -> Scenario:
    """Read and check one scenario file; ``machine`` replaces that of the file if it is given.

    Raises
    ------
    ConfigurationError
        The file cannot be read, is too large, is not YAML, or is not a valid scenario.
    """
    try:
        values = parse_yaml(read_text(path, FILE_LIMIT_BYTES, ConfigurationError))
    except OSError as error:
        raise ConfigurationError(f"{path}: cannot be read: {error}") from error
    except ValueError as error:
        raise ConfigurationError(f"{path}: not valid YAML: {error}") from error
    where = str(path)
    values = {} if values is None else values
    if machine and isinstance(values, Mapping):
        values = {**values, "machine": machine_path(machine)}
    return scenario_from_mapping(values, where, path.parent)


def machine_path(machine: str) -> str:
    """A machine as a user names it here: a file is one from the working directory."""
    return str(Path(machine).absolute()) if Path(machine).suffix in SUFFIXES else machine
