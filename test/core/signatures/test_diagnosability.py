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

"""Which faults can be told apart: known groups, extra sensors, and structural analysis."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from flea_diag.configuration.files import load_yaml
from flea_diag.core.bond_graph.actuator import Actuator, actuator
from flea_diag.core.causal_graph.operating_point import QUADRANTS
from flea_diag.core.faults.fault import Fault, catalogue, hypothesis, of_sensors
from flea_diag.core.signatures.diagnosability import (
    Diagnosability,
    diagnosability,
    extra_sensors,
    refutes,
    usable_residuals,
)

PERIOD = 0.01
RECORDED = [
    "motor_voltage",
    "motor_current",
    "actuator_position",
    "load_force",
    "motor_temperature",
    "nut_temperature",
    "ambient_temperature",
]


@pytest.fixture(scope="module")
def flea() -> Actuator:
    return actuator(load_yaml("actuator.yaml"))


@pytest.fixture(scope="module")
def faults(flea: Actuator) -> dict[str, Fault]:
    return catalogue(load_yaml("faults.yaml"), flea)


@pytest.fixture(scope="module")
def full(flea: Actuator, faults: dict[str, Fault]) -> Diagnosability:
    return diagnosability(flea, faults, period_s=PERIOD)


@pytest.mark.slow
def test_groups_that_slow_channels_cannot_split(full: Diagnosability) -> None:
    friction = {"jam", "spall", "ball_nut_friction"}
    for fault in friction:
        assert set(full.ambiguity[fault]) == friction
    assert full.ambiguity["supply_open"] == ("supply_open", "supply_short", "supply_sag")
    assert set(full.ambiguity["winding_open"]) == {"winding_open", "motor_failure"}
    assert full.ambiguity["winding_short"] == ("winding_short",)


@pytest.mark.slow
def test_what_only_vibration_can_show_is_named(full: Diagnosability) -> None:
    vibration = {"rotor_eccentricity", "accelerometer_1_fault", "accelerometer_2_fault"}
    assert vibration <= set(full.undetectable)
    assert not {"jam", "spall", "motor_current_bias"} & set(full.undetectable)


@pytest.mark.parametrize(
    "channel", ["motor_current", "motor_speed", "load_force", "actuator_position"]
)
def test_bias_of_a_motion_sensor_is_not_taken_for_the_plant_or_another_sensor(
    full: Diagnosability, channel: str
) -> None:
    assert all(g.startswith(channel) for g in full.ambiguity[f"{channel}_bias"])


def test_verdict_tells_by_design_from_not_yet(full: Diagnosability) -> None:
    words = full.verdict("supply_open", "supply_short")
    assert (
        words == "supply_open and supply_short are not isolable from each other with these sensors"
    )
    # Braking, a winding short's two effects on the motor current pull against each other.
    pair = ("jam", "motor_current_bias")
    assert full.verdict(*pair, seen=QUADRANTS).startswith("isolated by ")
    assert "not yet isolated: move the stand to" in full.verdict(*pair, seen=[])


def test_bias_of_current_needs_the_other_direction_to_be_told_from_scaling(
    full: Diagnosability,
) -> None:
    assert full.splits("motor_current_bias", "motor_current_scaling")
    for quadrant in QUADRANTS:
        one = Diagnosability(full.faults, full.residuals, {quadrant: full.tables[quadrant]})
        assert not one.splits("motor_current_bias", "motor_current_scaling")
    assert "several quadrants together" in full.verdict(
        "motor_current_bias", "motor_current_scaling", seen=QUADRANTS[:1]
    )


@pytest.mark.slow
def test_extra_sensor_that_would_split(flea: Actuator, faults: dict[str, Fault]) -> None:
    fewer = ["motor_current", "motor_speed", "motor_voltage", "actuator_position"]
    with_cell = diagnosability(
        flea.with_sensors([*fewer, "load_force"]),
        {n: faults[n] for n in ("jam", "winding_short")},
        period_s=PERIOD,
    )
    assert with_cell.splits("jam", "winding_short")
    found = extra_sensors(
        flea, ["motor_voltage", "motor_speed"], faults, "jam", "supply_open", PERIOD
    )
    assert {each.channel for each in found} >= {"load_force"}
    assert extra_sensors(flea, list(flea.sensors), faults, "jam", "spall", PERIOD) == ()


@pytest.mark.slow
def test_recorded_channels_alone(flea: Actuator) -> None:
    few = flea.with_sensors(RECORDED)
    assert "parity_mechanical" in usable_residuals(few)
    assert "parity_kinematic" not in usable_residuals(few)
    rows = of_sensors(catalogue(load_yaml("faults.yaml"), flea), few.sensors)
    found = diagnosability(few, rows, period_s=PERIOD)
    assert set(found.ambiguity["jam"]) == {"jam", "spall", "ball_nut_friction"}
    # The only position sensor: its bias shows in its own residual and in no relation.
    assert {"actuator_position_scaling", "actuator_position_dead"} <= set(
        found.ambiguity["actuator_position_bias"]
    )


@pytest.mark.parametrize(
    ("shown", "predicted", "how"),
    [
        ("0-", "00", "support"),
        ("*0", "00", "support"),
        ("+0", "0-", "sign"),
        ("+-", "0+", "slope"),
        ("0+", "++", ""),
        ("**", "0+", ""),
        ("00", "0+", ""),
    ],
)
def test_how_an_effect_refutes(shown: str, predicted: str, how: str) -> None:
    assert refutes(shown, predicted) == how


SINGLE = {
    "fR": "winding_resistance+",
    "fKm": "back_emf_constant+",
    "fKt": "torque_constant-",
    "fB": "screw_viscous_friction+",
    "fKl": "coupling_stiffness-",
    "fRl": "load_friction+",
    "fg": "drive_gain-",
    "fha": "housing_ambient_resistance+",
    "fna": "nut_ambient_resistance+",
}
SENSED = {
    "motor_voltage": "V",
    "motor_current": "i",
    "motor_speed": "w",
    "actuator_position": "xn",
    "load_position": "xl",
    "load_force": "F",
    "motor_temperature": "Th",
    "nut_temperature": "Tn",
}


MOTOR = ["motor_voltage", "motor_current", "motor_speed", "load_force"]
POSITION = ["motor_voltage", "motor_current", "actuator_position", "load_force", "nut_temperature"]


@pytest.mark.in_turn(2)
@pytest.mark.slow
@pytest.mark.parametrize(
    ("sensors", "by_sign"),
    [
        (list(SENSED), set()),
        # One equation each for structure; braking, current and speed have opposite signs.
        (MOTOR, {("fR", "fKm"), ("fB", "fKt")}),
        (POSITION, {("fR", "fKm")}),
    ],
    ids=["all", "motor", "position"],
)
def test_structural_isolability_and_every_extra_split_by_a_sign(
    flea: Actuator, sensors: list[str], by_sign: set[tuple[str, str]]
) -> None:
    """Structure knows supports only: what it cannot isolate, signs or slopes must have split."""
    toolbox = pytest.importorskip(
        "faultdiagnosistoolbox", reason="structural oracle not installed: faultdiagnosistoolbox"
    )
    isolable, names, detectable = structural_isolability(toolbox, sensors)
    rows = {
        **{f: _single(f, word) for f, word in SINGLE.items()},
        **{f"{c}_bias": _sensor(c) for c in sensors},
    }
    found = diagnosability(flea.with_sensors(sensors), rows)
    # What the structure cannot detect, no residual may show.
    assert set(names) - set(detectable) <= set(found.undetectable)
    if sensors == list(SENSED):
        assert set(detectable) == set(names)
        assert found.undetectable == ()
    pairs = [(a, b) for a in names for b in names if a != b]
    alike = [(a, b) for a, b in pairs if not isolable[names.index(a), names.index(b)]]
    extra = set()
    for one, other in alike:
        splits = found.splits(one, other)
        extra |= {(one, other)} if splits else set()
        assert not splits or any(s.by in ("sign", "slope") for s in splits), (one, other, splits)
    assert by_sign <= extra


def _single(name: str, word: str) -> Fault:
    return Fault(name, "", ((hypothesis(word),),), "physics", "abrupt", 0.2, False, "")


def _sensor(channel: str) -> Fault:
    from flea_diag.core.faults.fault import FaultHypothesis

    name = f"{channel}_bias"
    both = tuple((FaultHypothesis(channel, d, "bias"),) for d in (1, -1))
    return Fault(name, "", both, "physics", "abrupt", 0.2, False, "", channel, "bias")


def structural_isolability(
    toolbox: Any, sensors: list[str]
) -> tuple[np.ndarray, list[str], list[str]]:
    """Isolability matrix of the structure, written down by hand equation by equation."""
    states = ["i", "w", "d", "v", "Tw", "Th", "Tn", "xn", "xl"]
    equations = [
        ["u", "V", "fg"],
        ["di", "V", "i", "w", "R", "fKm"],
        ["dw", "i", "w", "F", "B", "fKt"],
        ["dd", "w", "v"],
        ["F", "d", "w", "v", "fKl"],
        ["dv", "F", "v", "uF", "fRl"],
        ["dTw", "i", "Tw", "Th", "R"],
        ["dTh", "Tw", "Th", "ua", "fha"],
        ["dTn", "w", "Tn", "ua", "B", "fna"],
        # A fault may enter one equation only: what acts in two is a variable with its own.
        ["R", "fR"],
        ["B", "fB"],
        ["dxn", "w"],
        ["dxl", "v"],
        *(toolbox.DiffConstraint(f"d{s}", s) for s in states),
        *([f"y_{c}", SENSED[c], f"{c}_bias"] for c in sensors),
    ]
    names = [*SINGLE, *(f"{c}_bias" for c in sensors)]
    model = toolbox.DiagnosisModel(
        {
            "type": "VarStruc",
            "x": [*states, *(f"d{s}" for s in states), "V", "F", "R", "B"],
            "f": names,
            "z": ["u", "uF", "ua", *(f"y_{c}" for c in sensors)],
            "rels": equations,
        },
        name="actuator",
    )
    # 1 in (row, column) where the row's fault cannot be isolated from the column's.
    matrix = np.asarray(model.IsolabilityAnalysis(permute=False))
    return matrix == 0, list(model.f), list(model.DetectabilityAnalysis()[0])
