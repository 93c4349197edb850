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

"""Relations of machines with a weight, an arm, a crank and a bridge, against the textbook's."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from support.places import CONFIG

from flea_diag.configuration.description import described
from flea_diag.core.bond_graph.actuator import Actuator, actuator
from flea_diag.core.residuals.parity import parity_relation
from flea_diag.core.residuals.relation_compiler import relation_set
from flea_diag.core.residuals.relation_set import DIRECTION

MOTOR: dict[str, Any] = {
    "schema_version": 1,
    "name": "drive",
    "scan_period_s": 0.01,
    "parameters": {
        "resistance": {"value": 1.0, "unit": "ohm"},
        "drop": {"value": 0.5, "unit": "V"},
        "side": {"value": 0.1, "unit": "A"},
        "constant": {"value": 0.2, "unit": "V*s/rad"},
        "rotor": {"value": 1e-3, "unit": "kg*m^2"},
        "dry": {"value": 0.05, "unit": "N*m"},
        "viscous": {"value": 1e-3, "unit": "N*m*s/rad"},
        "width": {"value": 2.0, "unit": "rad/s"},
        "radius": {"value": 0.03, "unit": "m"},
        "dead_centre": {"value": 0.2, "unit": "rad"},
        "weight": {"value": 40.0, "unit": "N"},
        "arm": {"value": 0.7, "unit": "N*m"},
        "ahead": {"value": 0.1, "unit": "N*m"},
    },
    "junctions": {
        "terminals": {"type": "0", "domain": "electrical"},
        "armature": {"type": "1", "domain": "electrical"},
        "shaft": {"type": "1", "domain": "rotation"},
        "slide": {"type": "1", "domain": "translation"},
    },
    "elements": {
        "supply": {"type": "MSf", "signal": "command"},
        "winding": {"type": "R", "parameters": {"resistance": "resistance"}},
        "bridge": {
            "type": "R",
            "law": "dry",
            "parameters": {"level": "drop", "smooth_flow": "side"},
        },
        "motor": {"type": "GY", "parameters": {"modulus": "constant"}},
        "inertia": {"type": "I", "state": "omega", "parameters": {"inertia": "rotor"}},
        "rubbing": {
            "type": "R",
            "law": "friction",
            "parameters": {"coulomb": "dry", "viscous": "viscous", "smooth_flow": "width"},
        },
        "beam": {
            "type": "C",
            "law": "link_weight",
            "state": "beam_angle",
            "parameters": {"level": "arm", "upright": "ahead"},
        },
        "crank": {
            "type": "TF",
            "law": "crank",
            "state": "crank_angle",
            "parameters": {"radius": "radius", "zero": "dead_centre"},
        },
        "gravity": {"type": "Se", "law": "constant_effort", "parameters": {"level": "weight"}},
    },
    "bonds": [
        "supply -> terminals",
        "terminals -> armature",
        "armature -> winding",
        "armature -> bridge",
        "armature -> motor",
        "motor -> shaft",
        "shaft -> inertia",
        "shaft -> rubbing",
        "shaft -> beam",
        "shaft -> crank",
        "crank -> slide",
        "slide -> gravity",
    ],
    "sensors": {
        "volts": {"at": "terminals", "unit": "V", "noise": 0.1},
        "amps": {"at": "armature", "unit": "A", "noise": 0.1},
        "turned": {"at": "shaft", "unit": "rad", "noise": 1e-3, "integrates": True, "state": "x_t"},
    },
    "inputs": {"command": {"unit": "A"}},
    "operating_point": {"hold": {"amps": 1.0}, "by": ["command"], "fixed": {"x_t": 0.0}},
    "residuals": {
        "parity_electrical": {"kind": "junction", "junction": "armature", "unit": "V"},
        "parity_mechanical": {"kind": "junction", "junction": "shaft", "unit": "N*m"},
    },
}


@pytest.fixture(scope="module")
def drive() -> Actuator:
    return actuator(MOTOR, sound=False)


def test_an_arm_and_a_crank_take_the_torque_that_their_angle_gives(drive: Actuator) -> None:
    relation = parity_relation(drive, drive.residuals["parity_mechanical"])
    q, w, a, i = 0.9, 3.0, -5.0, 2.0
    readings = {"amps": i, "turned": q, "d_turned": w, "d_d_turned": a}
    drag = 0.05 * np.tanh(w / 2.0) + 1e-3 * w + 1e-3 * a
    lifted = 40.0 * 0.03 * np.cos(q - 0.2) + 0.7 * np.cos(q) + 0.1 * np.sin(q)
    assert relation(readings) == pytest.approx(0.2 * i - drag - lifted)


def test_the_model_moves_as_the_relation_says(drive: Actuator) -> None:
    """State equations and relation come from one graph by different ways."""
    space = drive.state_space("stand", ["turned", "amps"])
    values = {"x_t": 0.9, "omega": 3.0, "beam_angle": 0.9, "crank_angle": 0.9}
    x = np.array([values[name] for name in space.states])
    rates = dict(zip(space.states, space.derivatives(x, np.array([2.0])), strict=True))
    relation = parity_relation(drive, drive.residuals["parity_mechanical"])
    readings = {"amps": 2.0, "turned": 0.9, "d_turned": 3.0, "d_d_turned": rates["omega"]}
    assert relation(readings) == pytest.approx(0.0, abs=1e-12)
    assert rates["beam_angle"] == rates["crank_angle"] == rates["x_t"] == 3.0


def test_the_direction_is_that_of_the_motion_not_of_the_current(drive: Actuator) -> None:
    known = relation_set(
        drive, ["parity_electrical", "parity_mechanical"], drive.graph.values(), ()
    )
    assert known.relations[0].name == "parity_mechanical"
    assert "d_turned" in str(known.shapes[DIRECTION])
    assert DIRECTION not in known.named["parity_electrical"].signals


def test_the_balance_of_an_arm_is_closed_across_a_spring_that_is_left_out() -> None:
    """T = J q'' + a cos q + b sin q, with the angle read before the spring."""
    made = described(CONFIG / "stands" / "shoulder" / "actuator.yaml")
    relation = parity_relation(made, made.residuals["parity_arm"])
    read = {"load_force": 30.0, "actuator_position": 0.7, "d_d_actuator_position": 2.0}
    values = made.graph.values()
    weight = values["arm_level"] * np.cos(0.7) + values["arm_upright"] * np.sin(0.7)
    assert relation(read) == pytest.approx(30.0 - 2.0 * values["arm_inertia"] - weight)
