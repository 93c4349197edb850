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

"""Signs against the balance of power: a motor computed in closed form, with signs turned."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
import pytest

from flea_diag.core.calibration.sign_check import roles_of, sign_contradiction

UNITS = {
    "motor_current": "A",
    "motor_voltage": "V",
    "actuator_position": "m",
    "motor_speed": "rad/s",
    "load_force": "N",
}
PERIOD_S = 0.01


def driven() -> dict[str, npt.NDArray[np.float64]]:
    """30 s of a motor: R = 3 ohm, K = 180 V s/m = N/A, 50 N of dry friction, 120 kg, a spring."""
    time = np.arange(3000) * PERIOD_S
    noise = np.random.default_rng(3).normal(size=(5, len(time)))
    phase = 2.0 * np.pi * 0.4 * time
    way, speed = 0.02 * np.sin(phase), 0.02 * 2.0 * np.pi * 0.4 * np.cos(phase)
    gain = -0.02 * (2.0 * np.pi * 0.4) ** 2 * np.sin(phase)
    load = 4000.0 * way + 40.0 * np.sin(0.7 * time)
    current = (load + 50.0 * np.sign(speed) + 120.0 * gain) / 180.0
    return {
        "motor_current": current + 0.05 * noise[0],
        "motor_voltage": 3.0 * current + 180.0 * speed + 0.3 * noise[1],
        "actuator_position": 0.05 + way + 6e-5 * noise[2],
        "motor_speed": speed / 5e-4 + 0.5 * noise[3],
        "load_force": load + 2.0 * noise[4],
    }


def said(turned: tuple[str, ...], left_out: tuple[str, ...] = ()) -> str:
    signals = {name: values for name, values in driven().items() if name not in left_out}
    columns = [-values if name in turned else values for name, values in signals.items()]
    units = {name: UNITS[name] for name in signals}
    return sign_contradiction(units, np.column_stack(columns), PERIOD_S)


def test_right_signs_contradict_nothing_and_all_turned_are_right_as_well() -> None:
    assert said(()) == ""
    moving = ("motor_current", "motor_voltage", "actuator_position", "motor_speed", "load_force")
    assert said(moving) == "", "the other direction is as good"


@pytest.mark.parametrize("channel", UNITS)
def test_one_turned_sign_is_named_with_its_coefficient_and_the_limit(channel: str) -> None:
    words = said((channel,))
    assert words.startswith(f"{channel}: ")
    assert " is -" in words
    assert words.endswith("by the balance of power it must be above 0: correct its sign")


def test_where_either_of_two_pairs_may_be_turned_both_are_named() -> None:
    words = said(("motor_current", "motor_voltage"), ("motor_speed",))
    assert words.startswith("actuator_position and load_force or motor_current and motor_voltage: ")


@pytest.mark.parametrize(
    "left_out", [("motor_voltage",), ("load_force",), ("motor_voltage", "load_force")]
)
def test_fewer_sensors_tell_the_sign_of_the_current_as_well(left_out: tuple[str, ...]) -> None:
    assert said((), left_out) == ""
    assert "motor_current" in said(("motor_current",), (*left_out, "motor_speed"))


def test_a_voltage_that_is_dead_is_a_fault_and_no_sign() -> None:
    signals = driven()
    signals["motor_voltage"] = -24.0 - 0.4 * signals["motor_current"]
    assert sign_contradiction(UNITS, np.column_stack([signals[n] for n in UNITS]), PERIOD_S) == ""


def test_the_load_of_a_supply_is_told_by_its_power() -> None:
    time = np.arange(3000) * PERIOD_S
    speed = np.where(np.sin(0.5 * time) > 0.0, 0.024, -0.024)
    position, load = np.cumsum(speed) * PERIOD_S, np.full(len(time), 300.0)
    noise = 0.02 * np.random.default_rng(5).normal(size=len(time))
    current = 0.4 + (800.0 * np.abs(speed) + load * speed) / 44.0 + noise
    units = {"motor_current": "A", "actuator_position": "m", "commanded_load": "N"}
    assert sign_contradiction(units, np.column_stack([current, position, load]), PERIOD_S) == ""
    words = sign_contradiction(units, np.column_stack([current, position, -load]), PERIOD_S)
    assert words.startswith("actuator_position or commanded_load: work on the load: supply ")


def test_roles_are_those_of_units_and_commands_have_none() -> None:
    units = {"commanded_voltage": "V", "angle": "rad", "torque": "N*m", "motor_current": "A"}
    assert roles_of(units) == {"current": "motor_current", "position": "angle", "load": "torque"}
