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

"""What a stand's files must say together: relations, and faults that show in them."""

from __future__ import annotations

import copy
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
import yaml
from support.places import FLEA_STAND

from flea_diag.configuration.calibrations import learned
from flea_diag.configuration.files import load_yaml
from flea_diag.configuration.knowledge import effects
from flea_diag.configuration.stand import load_stand
from flea_diag.errors import ConfigurationError

CALIBRATION = FLEA_STAND / "calibration_simulated_stand.yaml"


def written(path: Path, content: Any) -> Path:
    path.write_text(yaml.safe_dump(content), encoding="utf-8")
    return path


def test_a_fault_whose_effects_move_no_relation_is_refused_by_name(tmp_path: Path) -> None:
    """The winding settles within a scan: its inductance is in no relation."""
    content = copy.deepcopy(load_yaml("faults.yaml"))
    size = {"name": "inductance lost", "unit": "H", "moves": {"winding_inductance_h": -1}}
    content["faults"]["winding_short"]["effects"] = [{"sizes": [size]}]
    path = written(tmp_path / "faults.yaml", content)
    stand = load_stand(faults=path)
    with pytest.raises(ConfigurationError) as refused:
        effects(stand, learned(stand))
    assert str(refused.value).startswith(
        f"{path}: fault 'winding_short': what its effects change is"
    )
    assert "flea model equations prints them" in str(refused.value)
    assert "\n" not in str(refused.value)


def test_a_fault_that_the_sensors_of_a_stand_do_not_show_is_none_of_the_catalogue() -> None:
    """Without the commanded voltage nothing shows a supply that fails; the catalogue is right."""
    stand = load_stand()
    calibration = learned(stand)
    few = tuple(name for name in calibration.channels if name != "commanded_voltage")
    found = effects(stand, replace(calibration, channels=few))
    assert "supply_open" not in found.faults
    assert "supply_open" in effects(stand, calibration).faults


def test_a_description_whose_sensors_close_no_relation_says_what_is_missing(
    tmp_path: Path,
) -> None:
    content = copy.deepcopy(load_yaml("actuator.yaml"))
    kept = ("motor_current", "motor_temperature", "nut_temperature")
    content["sensors"] = {name: content["sensors"][name] for name in kept}
    content["residuals"] = {
        name: row
        for name, row in content["residuals"].items()
        if name in ("parity_electrical", "parity_mechanical")
    }
    content["predicted"] = content["travel"] = {}
    content["models"] = {"stand": {}}
    content["operating_point"]["hold"] = {"motor_current": 1.0}
    content["operating_point"]["by"] = ["commanded_voltage"]
    path = written(tmp_path / "actuator.yaml", content)
    with pytest.raises(ConfigurationError) as refused:
        effects(load_stand(actuator=path), learned(load_stand()))
    said = str(refused.value)
    assert said.startswith(f"{path}: its sensors close no relation: flea: no parity relation, at")
    assert said.endswith("add a sensor there")


def test_a_dead_voltage_lacks_what_the_balance_says_where_no_command_is_read() -> None:
    stand = load_stand()
    calibration = learned(stand)
    few = tuple(name for name in calibration.channels if name != "commanded_voltage")
    known = replace(calibration, channels=few)
    models = effects(stand, known).bound(known.parameters)
    (dead,) = [model for model in models if model.fault == "motor_voltage_dead"]
    signals = {term.regressor for term in dead.terms if term.index == 0}
    assert signals == {"motor_current", "motor_speed"}
