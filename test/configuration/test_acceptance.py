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

"""A stand is taken as a whole or refused in one line, by whichever command comes first."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
import yaml
from support.places import ROOT

from flea_diag.configuration.acceptance import require_accepted, require_usable
from flea_diag.configuration.stand import Stand, load_stand
from flea_diag.errors import FleaError, ModelError

JOINT = ROOT / "config" / "stands" / "joint"


def changed(folder: Path, change: Callable[[dict[str, Any]], object]) -> Stand:
    """The shipped joint with another description."""
    place = folder / "joint"
    shutil.copytree(JOINT, place)
    path = place / "actuator.yaml"
    content = yaml.safe_load(path.read_text(encoding="utf-8"))
    change(content)
    path.write_text(yaml.safe_dump(content), encoding="utf-8")
    return load_stand(place)


def without_voltage(content: dict[str, Any]) -> None:
    for key, name in (
        ("sensors", "motor_voltage"),
        ("residuals", "parity_electrical"),
        ("tolerances", "voltage_offset_v"),
        ("base_parameters", "voltage_offset_v"),
    ):
        content[key].pop(name)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda c: c["base_parameters"].pop("stribeck_speed_m_s"), "no stribeck_speed_m_s"),
        (lambda c: c["tolerances"].pop("thermal_rate_k_per_s"), "no thermal_rate_k_per_s"),
        (lambda c: c["operating_point"].update(by=["commanded_current", "angle"]), "operating_poi"),
        (lambda c: c["sensors"].pop("motor_current"), "motor_current"),
        (without_voltage, "sensor_errors: 'motor_voltage' is no sensor of joint"),
    ],
    ids=["no width", "no heating", "not held", "no current", "no voltage"],
)
def test_what_a_later_step_would_refuse_is_refused_at_once(
    change: Callable[[dict[str, Any]], object], words: str, tmp_path: Path
) -> None:
    stand = changed(tmp_path, change)
    with pytest.raises(FleaError, match=words) as refusal:
        require_accepted(stand)
    assert "\n" not in str(refusal.value)


def test_a_shipped_stand_is_taken() -> None:
    for name in ("flea", "joint", "cranfield"):
        require_accepted(load_stand(name))


def test_an_operating_point_that_cannot_be_held_is_named(tmp_path: Path) -> None:
    content = yaml.safe_load((JOINT.parent / "axis" / "actuator.yaml").read_text("utf-8"))
    content["operating_point"] = {"hold": {"motor_temperature": 80.0}, "by": ["speed"], "fixed": {}}
    path = tmp_path / "actuator.yaml"
    path.write_text(yaml.safe_dump(content), "utf-8")
    said = "operating_point holds motor_temperature = 80 by speed: that cannot be held"
    with pytest.raises(ModelError, match=said):
        require_usable(path)
