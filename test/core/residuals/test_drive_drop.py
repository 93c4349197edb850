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

"""A voltage and its command with a bridge between: it takes a part on the side of the current."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import yaml

from flea_diag.configuration import description
from flea_diag.configuration.calibrations import learned
from flea_diag.configuration.stand import load_stand
from flea_diag.core.bond_graph.actuator import Actuator
from flea_diag.core.bond_graph.actuator import actuator as read_actuator
from flea_diag.core.residuals.parity import parity_relation
from flea_diag.errors import ConfigurationError, ModelError

STAND = load_stand("ema")
DRIVE, DROP_V, SMOOTH_A = "parity_drive", 0.25, 0.3
PARAMETERS = {"drive_drop": DROP_V, "drive_gain": 0.98, "drive_offset": 0.1}


def model() -> Actuator:
    return description.described(STAND.actuator)


@pytest.mark.parametrize("current_a", [-9.0, -0.1, 0.0, 0.1, 9.0])
def test_a_bridge_takes_its_drop_on_the_side_of_the_current(current_a: float) -> None:
    drop = DROP_V * np.tanh(current_a / SMOOTH_A)
    readings = {"commanded_voltage": 12.0, "motor_current": current_a}
    readings["motor_voltage"] = 0.98 * 12.0 + 0.1 - drop
    relation = parity_relation(model(), model().residuals[DRIVE])
    assert relation(readings, PARAMETERS) == pytest.approx(0.0, abs=1e-12)
    assert relation.sided == ("motor_current",)


def test_recordings_fix_the_drop() -> None:
    """The simulated bridge has 0.25 V."""
    calibration = learned(STAND)
    drop, sigma = calibration.parameters.drive_drop_v, calibration.sigmas["drive_drop_v"]
    assert sigma < 0.1 * drop
    assert abs(drop - DROP_V) < 3.0 * sigma


@pytest.mark.slow
@pytest.mark.parametrize("mode", ["bias", "scaling", "drift", "dead"])
def test_an_error_of_the_current_may_show_another_side(mode: str) -> None:
    channels = (*model().sensors, *model().inputs)
    _, tables = description.signatures(
        STAND.actuator, STAND.faults, channels, model().scan_period_s
    )
    for table in tables.values():
        assert str(table[f"motor_current_{mode}"][DRIVE]).startswith("**")
        assert str(table["load_force_bias"][DRIVE]).startswith("00")


def test_a_resistor_elsewhere_lies_between_no_two_voltages() -> None:
    spec = replace(model().residuals[DRIVE], across="winding")
    with pytest.raises(ModelError, match=r"no 1-junction joins the source of .* winding"):
        parity_relation(model(), spec)


def test_what_takes_nothing_lies_between_no_two_readings() -> None:
    content = yaml.safe_load(Path(STAND.actuator).read_text(encoding="utf-8"))
    content["residuals"][DRIVE]["across"] = "rotor"
    with pytest.raises(ConfigurationError, match=r"across 'rotor' is no element of type C or R"):
        read_actuator(content, "here")
