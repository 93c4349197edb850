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

"""Which residuals a description allows, for stands with other sensors than the FLEA's."""

from __future__ import annotations

import copy
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
import yaml
from support.models.stepper import DESCRIPTION

from flea_diag.configuration.description import compiled_relations
from flea_diag.configuration.files import load_yaml
from flea_diag.configuration.stand import load_stand
from flea_diag.core.residuals.residual_rows import SPEED, ResidualSet

FLEA = compiled_relations("actuator.yaml").residuals
WING = compiled_relations(load_stand("wing").actuator).residuals


def rows(
    folder: Path, change: Callable[[dict[str, Any]], None] = lambda _: None, base: Any = DESCRIPTION
) -> ResidualSet:
    content = copy.deepcopy(base)
    change(content)
    path = folder / "mine.yaml"
    path.write_text(yaml.safe_dump(content, sort_keys=False))
    return compiled_relations(path).residuals


def named(known: ResidualSet) -> list[str]:
    return [row.name for row in known.rows if row.gate != "sensor"]


def test_the_flea_has_what_it_was_calibrated_with():
    assert FLEA.channels == (
        "motor_current", "motor_voltage", "commanded_voltage", "motor_speed", "actuator_position",
        "load_position", "load_force", "motor_temperature", "nut_temperature",
        "ambient_temperature",
    )  # fmt: skip
    assert named(FLEA) == [
        "parity_mechanical", "parity_mechanical_dn", "parity_electrical", "parity_electrical_dn",
        "parity_drive", "parity_kinematic", "parity_speed",
        "motor_temperature", "nut_temperature", "ambient_temperature",
        *(f"innovation_{channel}{end}" for channel in
          ("motor_current", "motor_speed", "actuator_position") for end in ("", "_dn")),
    ]  # fmt: skip
    assert [row.name for row in FLEA.rows if row.gate == "moving"] == [
        "parity_mechanical", "parity_mechanical_dn", "parity_electrical_dn", *FLEA.innovations,
    ]  # fmt: skip
    assert (FLEA.friction, FLEA.circuit) == ("parity_mechanical", "parity_electrical")
    assert FLEA.twins == ("parity_kinematic", "parity_speed")
    assert FLEA.zeros == {
        "parity_mechanical": "current_offset_a",
        "parity_electrical": "voltage_offset_v",
    }
    assert FLEA.own == {
        "parity_speed": ("motor_speed", "actuator_position"),
        "ambient_temperature": ("ambient_temperature",),
    }
    assert [FLEA.rows[j].name for j in FLEA.spreading] == named(FLEA)[:4]


def test_a_supply_s_power_is_all_that_a_stepper_has(tmp_path):
    known = rows(tmp_path)
    assert known.units == {"motor_current": "A", "actuator_position": "m", "commanded_load": "N"}
    assert named(known) == ["parity_power"]
    (power,) = (row for row in known.rows if row.name == "parity_power")
    assert (power.unit, power.gate) == ("W", "always")
    assert set(power.needs) == {"motor_current", SPEED, "commanded_load"}
    assert (known.friction, known.circuit, known.encoder) == ("parity_power", "", "")
    assert known.required == ("motor_current", "commanded_load", "actuator_position")
    tested = {row.needs[0] for row in known.sensor_rows}
    assert tested == {"motor_current", "actuator_position"}


def test_a_wing_has_the_rows_of_its_own_sensors():
    assert WING.units["surface_angle"] == "rad"
    assert (WING.friction, WING.circuit) == ("parity_mechanical", "parity_electrical")
    assert WING.column("parity_kinematic") == WING.channel("nut_temperature") == -1
    assert set(WING.predictions) == {"motor_temperature", "ambient_temperature"}
    # No test of single sensors knows how far an angle may step.
    assert WING.positions == ("actuator_position", "surface_angle")
    assert WING.symptoms.positions == ("actuator_position",)


def test_without_a_driven_model_there_is_no_observer(tmp_path):
    def undriven(content: dict[str, Any]) -> None:
        content["models"].pop("driven")
        kept = content["residuals"].items()
        content["residuals"] = {n: r for n, r in kept if r.get("model") != "driven"}
        content.pop("predicted")

    assert rows(tmp_path, undriven, load_yaml("actuator.yaml")).innovations == ()


def test_a_reference_that_drives_the_graph_elsewhere_is_no_second_reading(tmp_path):
    """The FLEA's load is commanded behind a mass and a damper: held against it is no relation."""
    assert FLEA.column("parity_load") == -1

    def beside(content: dict[str, Any]) -> None:
        content["residuals"]["parity_load"]["reference"] = "load_position"
        content["residuals"]["parity_load"]["channel"] = "actuator_position"
        content["residuals"]["parity_load"]["unit"] = "m"

    found = rows(tmp_path, beside, load_yaml("actuator.yaml"))
    assert "parity_load" in found.place


@pytest.mark.parametrize(
    ("sensor", "gone"),
    [
        ("motor_speed", {"parity_speed", "innovation_motor_speed"}),
        ("load_position", {"parity_kinematic"}),
        ("nut_temperature", {"nut_temperature"}),
        ("motor_voltage", {"parity_electrical", "parity_drive", "innovation_motor_current"}),
    ],
)
def test_what_a_description_lacks_means_fewer_rows(tmp_path, sensor, gone):
    def without(content: dict[str, Any]) -> None:
        content["sensors"].pop(sensor)
        kept = content["residuals"].items()
        content["residuals"] = {
            n: r for n, r in kept if sensor not in (r.get("channel"), r.get("reference"))
        }
        content["operating_point"].update(hold={"motor_current": 1.0}, by=["commanded_voltage"])
        if sensor == "motor_voltage":
            content["models"] = {"stand": {}}
            content.pop("predicted")
            content["residuals"] = {
                n: r for n, r in content["residuals"].items() if r.get("model") != "driven"
            }
        if sensor == "load_position":
            content["models"]["driven"].pop("moved")

    found = rows(tmp_path, without, load_yaml("actuator.yaml"))
    assert sensor not in found.index
    assert gone <= set(named(FLEA)) - set(named(found))
    assert not any(sensor in row.needs for row in found.rows)
    assert [name for name in named(FLEA) if name in found.place] == named(found)
