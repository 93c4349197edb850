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

"""Modes of a machine in a description: what is taken, and what is refused in one line."""

from __future__ import annotations

from typing import Any

import pytest
from support.places import ROOT

from flea_diag.configuration.files import load_yaml
from flea_diag.core.bond_graph.actuator import actuator
from flea_diag.errors import ConfigurationError

AXIS = ROOT / "config" / "stands" / "axis" / "actuator.yaml"


def described(**row: Any) -> Any:
    content = load_yaml(str(AXIS))
    return actuator({**content, "modes": {"braked": {"channel": "brake_engaged", **row}}})


def test_a_channel_that_tells_a_mode_is_a_channel_of_the_machine() -> None:
    made = described(above=0.5, holds="carriage", settles_s=0.2)
    assert made.units["brake_engaged"] == "1"
    assert "brake_engaged" not in made.sensors
    assert made.modes["braked"].settles_s == 0.2


@pytest.mark.parametrize(
    ("row", "said"),
    [
        ({}, "brake_engaged has no limit; say above or below"),
        ({"above": 1.0, "below": 0.5}, "above = 1 must be less than below = 0.5"),
        ({"above": 0.5, "holds": "nowhere"}, "holds 'nowhere', which is no 1-junction"),
        ({"above": 0.5, "holds": "bus"}, "holds 'bus', which is no 1-junction"),
        ({"above": 0.5, "voids": ["gap"]}, "'gap' is no residual, known are motor_temperature"),
        ({"above": 0.5, "only": ["gap"]}, "'gap' is no residual"),
        ({"above": 0.5, "channel": "bus_voltage"}, "bus_voltage is in 'V', not in '1'"),
        ({"above": 0.5, "settles_s": -1.0}, "settles_s = -1.0 is below its limit"),
        ({"above": 0.5, "frees": "carriage"}, "unknown key 'frees'"),
    ],
)
def test_what_no_machine_can_be_in_is_refused(row: dict[str, Any], said: str) -> None:
    with pytest.raises(ConfigurationError, match="mode 'braked'") as refused:
        described(**row)
    assert said in str(refused.value)
    assert "\n" not in str(refused.value)
