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

"""A machine is what its file says; a bad file is refused by name, value and remedy."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from support.places import ROOT
from support.stand_runs import scans

from flea_diag.errors import ConfigurationError
from flea_diag.wire.bags.bag import read_bag
from flea_diag.wire.records import ChannelTable, Record, Scan
from flea_sim_driver.faults import catalogue
from flea_sim_driver.machine.library import find_machine, machine_names
from flea_sim_driver.machine.machine_file import load_machine, machine_from_mapping
from flea_sim_driver.scenario.library import find_scenario, scenario_names
from flea_sim_driver.scenario.scenario_file import overridden
from flea_sim_driver.scenario.table4 import CampaignRow, Shared, draw
from flea_sim_driver.stand import SimulatedStand

MACHINES = ROOT / "config" / "machines"
FLEA: dict[str, Any] = yaml.safe_load((MACHINES / "flea.yaml").read_text())


def test_every_machine_of_the_package_is_found_by_its_name() -> None:
    assert set(machine_names()) == {path.stem for path in MACHINES.glob("*.yaml")}
    assert all(find_machine(name).name == name for name in machine_names())


def test_the_flea_is_the_machine_of_its_recorded_bag() -> None:
    """Scans of bags/unit_switch_jam, which both units and a jam made before machines had files."""
    recorded = [record for _, record in read_bag(ROOT / "bags" / "unit_switch_jam", (Scan,))]
    scenario = overridden(find_scenario("unit_switch_jam"), "test", {"duration_s": 22.0})
    made = [record for record in SimulatedStand(scenario) if isinstance(record, Scan)]
    assert len(made) == len(recorded) == 2200
    was, now = scans(recorded), scans(made)
    for channel, values in was.items():
        np.testing.assert_allclose(now[channel], values, rtol=1e-9, atol=1e-12, err_msg=channel)


@pytest.mark.parametrize("name", machine_names())
def test_every_fault_that_a_machine_can_have_acts_on_it(name: str) -> None:
    machine = find_machine(name)
    scenario = find_scenario("nominal", name)
    assert "nominal" in scenario_names(name)
    assert scenario.machine is machine
    healthy = readings(list(SimulatedStand(overridden(scenario, name, {"duration_s": 3.0}))))
    assert np.isfinite(healthy).all()
    silent = []
    for fault, row in catalogue(machine).items():
        if row.places != ("plant",):
            continue  # of sensors, which the tests of faults cover
        told = {"fault": fault, "onset_s": 1.0}
        run = overridden(scenario, name, {"duration_s": 3.0}, told)
        if np.array_equal(readings(list(SimulatedStand(run))), healthy):
            silent.append(fault)
    assert silent == []


@pytest.mark.parametrize("name", machine_names())
def test_a_machine_follows_every_motion_that_campaigns_draw_for_it(name: str) -> None:
    drawn = draw((CampaignRow("Nominal", "", 80),), 5, Shared(machine=name))
    made = [scenario for _, scenario in drawn]
    assert {scenario.motion.kind for scenario in made} == {"sine", "trapezoid", "triangle", "sweep"}
    assert {scenario.machine.name for scenario in made} == {name}


def readings(run: list[Record]) -> Any:
    """All values of a run, shape (scans, channels)."""
    return np.array([record.values for record in run if isinstance(record, Scan)])


@pytest.mark.parametrize("name", machine_names())
def test_a_machine_sends_the_channels_of_its_file_at_its_rate(name: str) -> None:
    machine = find_machine(name)
    run = SimulatedStand(overridden(find_scenario("nominal", name), name, {"duration_s": 0.2}))
    records = list(run)
    table = next(record for record in records if isinstance(record, ChannelTable))
    slow = [row for row in table.channels if row.name in machine.channels]
    assert tuple(row.name for row in slow) == machine.channels
    stamps = [record.stamp_ns for record in records if isinstance(record, Scan)]
    assert set(np.diff(stamps)) == {round(1e9 / machine.sampling.scan_rate_hz)}


def test_a_slow_instrument_is_held_between_its_readings() -> None:
    """The joint's temperature is read twice a second, in every fifth block of the simulation."""
    joint = find_machine("joint")
    run = SimulatedStand(
        overridden(find_scenario("nominal", "joint"), "joint", {"duration_s": 3.0})
    )
    warm = readings(list(run))[:, joint.channels.index("motor_temperature")]
    read = warm[::50]
    np.testing.assert_array_equal(warm, np.repeat(read, 50))
    assert len(set(read)) > 1


def test_a_unit_of_its_own_seed_is_the_same_in_runs_with_other_noise() -> None:
    nominal = find_scenario("nominal")
    first, again, other = (
        SimulatedStand(overridden(nominal, "test", {"seed": seed, "unit_seed": unit}))
        for seed, unit in ((1, 7), (2, 7), (1, 8))
    )
    assert first.units == again.units != other.units
    assert first.scenario.serial("Y") == again.scenario.serial("Y") != other.scenario.serial("Y")
    assert not np.array_equal(readings(list(first.advance())), readings(list(again.advance())))


CHANGES: dict[str, tuple[dict[str, Any], tuple[str, ...]]] = {
    "missing": ({"unit": {"lead_m": None}}, ("unit", "lead_m", "missing")),
    "unknown": ({"bench": {"colour": 1.0}}, ("bench", "colour", "known are")),
    "section": ({"motors": {}}, ("motors", "known are")),
    "zero": ({"unit": {"reflected_mass_kg": 0.0}}, ("reflected_mass_kg", "0.0", "above 0")),
    "nan": ({"heat": {"copper_per_k": float("nan")}}, ("copper_per_k", "nan", "finite")),
    "rate": ({"sampling": {"scan_rate_hz": 130.0}}, ("scan_rate_hz", "130.0", "2000")),
    "slow": (
        {
            "instruments": {
                "motor_current": {
                    "unit": "A",
                    "noise": 0.0,
                    "resolution": 0.0,
                    "minimum": -1.0,
                    "maximum": 1.0,
                    "rate_hz": 30.0,
                }
            }
        },
        ("motor_current", "30.0", "100"),
    ),
    "spread": ({"spread": {"colour": 0.1}}, ("spread", "colour", "it has")),
    "width": ({"spread": {"lead_error_m": 2.0}}, ("lead_error_m", "2.0", "above its limit 1.0")),
    "pair": ({"drawn": {"centre_m": [0.1]}}, ("centre_m", "must have 2 entries")),
}


@pytest.mark.parametrize("name", CHANGES)
def test_a_machine_that_cannot_be_is_refused_by_name_and_value(name: str) -> None:
    change, words = CHANGES[name]
    content = {**FLEA}
    for section, values in change.items():
        changed = {**content.get(section, {}), **values}
        content[section] = {key: value for key, value in changed.items() if value is not None}
    with pytest.raises(ConfigurationError) as refused:
        machine_from_mapping(content, "mine.yaml")
    text = str(refused.value)
    assert text.startswith("mine.yaml")
    assert "\n" not in text
    assert all(word in text for word in words), text


def test_a_fault_without_its_numbers_is_refused() -> None:
    content = {**FLEA, "faults": {"jam": {"size": 1.0, "minimum": 0.1, "maximum": 2.0}}}
    with pytest.raises(ConfigurationError, match=r"jam: 'coulomb_n' is missing"):
        catalogue(machine_from_mapping(content, "mine.yaml"))


def test_a_machine_of_ones_own_runs_from_its_file(tmp_path: Path) -> None:
    path = tmp_path / "mine.yaml"
    path.write_text(yaml.safe_dump({**FLEA, "name": "mine"}))
    assert load_machine(path).unit == find_machine("flea").unit
    scenario = find_scenario("nominal", str(path))
    assert scenario.machine.name == "mine"
    with pytest.raises(ConfigurationError, match="neither a YAML file nor one of"):
        find_scenario("nominal", "mine")
