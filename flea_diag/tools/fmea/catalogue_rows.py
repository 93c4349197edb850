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

"""Which failures an FMEA analyses: each row of the catalogue at each size."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

from flea_diag.configuration.description import faults_of
from flea_diag.configuration.stand import Stand
from flea_diag.core.faults.fault import Fault
from flea_diag.errors import ConfigurationError, question, shown
from flea_diag.tools.fmea.failure import Failure
from flea_sim_driver.failure_modes import FAILURE_MODES, table1
from flea_sim_driver.faults import FaultRow, catalogue
from flea_sim_driver.machine.machine import Machine
from flea_sim_driver.scenario.scenario import Scenario
from flea_sim_driver.scenario.scenario_file import scenario_to_mapping


def known_faults(stand: Stand) -> Mapping[str, Fault]:
    """The catalogue of the stand."""
    return faults_of(stand.actuator, stand.faults)


def chosen(failures: Sequence[Failure], named: Sequence[str]) -> tuple[Failure, ...]:
    """Those of these faults; all where none is named.

    Raises
    ------
    ConfigurationError
        There is no such fault.
    """
    known = {each.fault for each in failures}
    for name in named:
        if name not in known:
            raise ConfigurationError(f"--fault {shown(name)}: no such row{question(name, known)}")
    return tuple(each for each in failures if not named or each.fault in named)


def simulated(
    scenario: Scenario, known: Mapping[str, Fault], onset_s: float, shares: Sequence[float]
) -> Iterator[Failure]:
    """Each fault of the machine at each size, and those of the catalogue that it cannot have."""
    rows = catalogue(scenario.machine)
    for row in rows.values():
        names, remark = nearest_rows(row.id, known)
        shaken = row.id in known and by_vibration(known[row.id])
        for size in sizes(row, shares):
            values = scenario_to_mapping(scenario)
            sensors = {**values.get("sensors", {}), "vibration": shaken}
            fault = {"fault": row.id, "onset_s": onset_s, "size": size}
            yield Failure(
                f"{row.id}_{size:g}", row.id, row.title, component(row, known), size,
                row.size_unit, names, {**values, "sensors": sensors, "faults": [fault]},
                remark=remark, of_sensor=bool(row.channel),
            )  # fmt: skip
    for name, fault in known.items():
        if name not in rows:
            why = f"the machine {scenario.machine.name} has no such fault to simulate"
            yield Failure(name, name, fault.response.name, fault.component, remark=why)


def of_table1(known: Mapping[str, Fault], machine: Machine, seed: int) -> Iterator[Failure]:
    """The 25 failure modes of the paper's Table 1."""
    rows = catalogue(machine)
    for mode, scenario in zip(FAILURE_MODES, table1(seed), strict=True):
        row = rows[mode.fault]
        yield Failure(
            mode.name, mode.fault, f"{mode.mode}: {mode.effect}", mode.component,
            mode.course.get("size", row.default_size), row.size_unit, mode.group,
            scenario_to_mapping(scenario), remark=f"found by: {mode.found}",
        )  # fmt: skip


def by_vibration(fault: Fault) -> bool:
    """Whether a fault shows in vibration alone: its bag takes the accelerometers too."""
    return fault.vibration and (fault.approach == "data" or not fault.effects)


def nearest_rows(fault: str, known: Mapping[str, Fault]) -> tuple[tuple[str, ...], str]:
    """What the diagnosis calls a fault that the catalogue lacks, and what finds it."""
    if fault in known:
        return (), ""
    modes = [mode for mode in FAILURE_MODES if mode.fault == fault]
    found = f"; found by: {modes[0].found}" if modes else ""
    names = tuple(name for mode in modes for name in mode.group)
    return names, f"not in the catalogue of the stand{found}"


def component(row: FaultRow, known: Mapping[str, Fault]) -> str:
    """What fails."""
    if row.id in known:
        return known[row.id].component.replace("_", " ")
    modes = (mode.component.lower() for mode in FAILURE_MODES if mode.fault == row.id)
    return next(modes, (row.channel or row.id).replace("_", " "))


def sizes(row: FaultRow, shares: Sequence[float]) -> tuple[float, ...]:
    """Shares of the default size within its limits; of a scaling, of its difference from 1."""
    if row.mode == "dead":
        return (row.default_size,)
    rest = 1.0 if row.mode == "scaling" else 0.0
    made = (rest + share * (row.default_size - rest) for share in shares)
    within = (min(max(size, row.minimum), row.maximum) for size in made)
    return tuple(dict.fromkeys(float(f"{size:.6g}") for size in within))
