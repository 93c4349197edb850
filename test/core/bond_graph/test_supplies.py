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

"""Supplies of a description: what is refused, and a relation that they modulate."""

from __future__ import annotations

import copy
from collections.abc import Callable
from typing import Any

import pytest
import yaml
from support.places import CONFIG

from flea_diag.core.bond_graph.actuator import actuator
from flea_diag.core.residuals.parity import parity_relation
from flea_diag.errors import ConfigurationError

AXIS = yaml.safe_load((CONFIG / "stands" / "axis" / "actuator.yaml").read_text("utf-8"))
EMA = yaml.safe_load((CONFIG / "stands" / "ema" / "actuator.yaml").read_text("utf-8"))


def changed(change: Callable[[dict[str, Any]], Any]) -> dict[str, Any]:
    content = copy.deepcopy(AXIS)
    change(content)
    return content


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda c: c["supplies"]["link"].pop("low"), "bus_voltage has no band; say between which"),
        (lambda c: c["supplies"]["link"].update(low=350.0), "low = 350 must be less than high"),
        (lambda c: c["supplies"]["link"].update(low=320.0), "bus_level = 310 is not in its band"),
        (lambda c: c["supplies"]["link"].update(channel="amps"), "'amps' is no sensor"),
        (lambda c: c["residuals"].pop("parity_supply"), "no residual holds bus_voltage against"),
        (
            lambda c: c["residuals"]["parity_supply"].update(offset="volts"),
            "residual 'parity_supply' has offset 'volts', which is no parameter",
        ),
        (
            lambda c: c["residuals"]["parity_speed"].update(supplied_by="mains"),
            "supplied_by 'mains' is no supply, known are link",
        ),
    ],
)
def test_a_supply_that_cannot_be_is_refused_in_a_line(
    change: Callable[[dict[str, Any]], Any], words: str
) -> None:
    with pytest.raises(ConfigurationError) as refused:
        actuator(changed(change))
    assert words in str(refused.value)
    assert "\n" not in str(refused.value)


def test_a_bridge_of_given_duty_passes_its_supply_on() -> None:
    """V = g u_command U / U_0 + u_0: worked on paper."""
    content = copy.deepcopy(EMA)
    content["parameters"]["rail"] = {"value": 48.0, "unit": "V"}
    content["junctions"]["link"] = {"type": "0", "domain": "electrical"}
    content["elements"]["mains"] = {
        "type": "Se", "law": "constant_effort", "parameters": {"level": "rail"},
    }  # fmt: skip
    content["bonds"].append("mains -> link")
    content["sensors"]["bus_voltage"] = {"at": "link", "unit": "V", "noise": 0.1}
    content["residuals"]["parity_supply"] = {
        "kind": "difference", "channel": "bus_voltage", "offset": "rail", "unit": "V",
    }  # fmt: skip
    content["supplies"] = {"rail": {"channel": "bus_voltage", "low": 44.0, "high": 52.0}}
    drive = content["residuals"]["parity_drive"]
    drive["supplied_by"] = "rail"
    del drive["across"]
    made = actuator(content)
    relation = parity_relation(made, made.residuals["parity_drive"])
    read = {"motor_voltage": 9.0, "commanded_voltage": 10.0, "bus_voltage": 36.0}
    assert relation(read) == pytest.approx(9.0 - 1.0 * 10.0 * 36.0 / 48.0)
