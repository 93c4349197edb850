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

"""Parity relations on motions integrated from equations written by hand."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from support.models import ema_oracle as oracle

from flea_diag.configuration.files import load_yaml
from flea_diag.core.bond_graph.actuator import Actuator, ResidualSpec, actuator
from flea_diag.core.faults.fault import FaultHypothesis, hypothesis
from flea_diag.core.residuals.measured_graph import channel_of
from flea_diag.core.residuals.parity import ParityRelation, parity_relation
from flea_diag.core.symbolic.expression import evaluate
from flea_diag.errors import ModelError

P = {name: float(text) for name, text in oracle.PARAMETERS.items()}
ENCODER = ["motor_voltage", "motor_current", "motor_speed", "load_force", "nut_temperature"]
FLEA = ["motor_voltage", "motor_current", "actuator_position", "load_force", "nut_temperature"]


def motion(p: dict[str, float]) -> dict[str, float]:
    """Channels and exact rates at one instant of a motion that accelerates."""
    x = dict(zip(oracle.STATES, (1.3, 40.0, 2.2e-5, 0.02, 33, 30, 27, 0.05, 0.05), strict=True))
    u = {"commanded_voltage": 9.0, "commanded_load": 70.0, "ambient_temperature": 24.0}
    slope = oracle.rates(x, u, p, oracle.smooth_friction(x["omega"], p))
    rho = p["screw_ratio"]
    return {
        **oracle.readings(x, p),
        "motor_voltage": 9.0,
        "ambient_temperature": 24.0,
        "d_motor_current": slope["i"],
        "d_motor_speed": slope["omega"],
        "d_actuator_position": rho * x["omega"],
        "d_d_actuator_position": rho * slope["omega"],
        "d_nut_temperature": slope["T_nut"],
    }


def relation(model: Actuator, name: str) -> ParityRelation:
    """With the inductance, which the description leaves out: here the current accelerates."""
    return parity_relation(model, replace(model.residuals[name], without=()))


def value(made: ParityRelation, channels: dict[str, float]) -> float:
    return float(made({name: channels[name] for name in made.arguments}))


@pytest.fixture(scope="module")
def flea() -> Actuator:
    return actuator(load_yaml("actuator.yaml")).with_parameters({"friction_smooth_speed": 3.0})


@pytest.mark.parametrize("sensors", [ENCODER, FLEA], ids=["encoder", "position only"])
@pytest.mark.parametrize("name", ["parity_electrical", "parity_mechanical", "parity_mechanical_dn"])
def test_relation_is_zero_without_a_fault(flea: Actuator, sensors: list[str], name: str) -> None:
    made = relation(flea.with_sensors(sensors), name)
    assert {channel for channel, _ in map(channel_of, made.arguments)} <= set(sensors)
    assert value(made, motion(P)) == pytest.approx(0.0, abs=1e-7)


def test_a_store_that_settles_within_a_scan_is_left_out(flea: Actuator) -> None:
    model, readings = flea.with_sensors(ENCODER), motion(P)
    made = parity_relation(model, model.residuals["parity_electrical"])
    assert "d_motor_current" not in made.arguments
    drop = P["winding_inductance"] * readings["d_motor_current"]
    assert value(made, readings) == pytest.approx(drop, rel=1e-9)


def test_two_readings_agree_up_to_gain_and_offset(flea: Actuator) -> None:
    readings = {"motor_voltage": 9.4, "commanded_voltage": 10.0}
    made = parity_relation(flea, flea.residuals["parity_drive"])
    assert float(made(readings, {"drive_gain": 0.9, "drive_offset": 0.3})) == pytest.approx(0.1)


def test_an_encoder_is_held_against_a_position_at_the_nut(flea: Actuator) -> None:
    made = parity_relation(flea, flea.residuals["parity_speed"])
    assert str(made.expression) == "motor_speed*screw_ratio - d_actuator_position"
    readings = {"motor_speed": 100.0, "d_actuator_position": 0.05}
    assert float(made(readings)) == pytest.approx(100.0 * 5.0532e-4 - 0.05)


def test_readings_exceed_what_they_measure_by_their_offsets(flea: Actuator) -> None:
    model, readings = flea.with_sensors(ENCODER), motion(P)
    made = relation(model, "parity_electrical")
    shifted = {**readings, "motor_voltage": readings["motor_voltage"] + 0.7}
    assert float(made(shifted, {"voltage_offset": 0.7})) == pytest.approx(0.0, abs=1e-7)


def test_heat_balance_of_the_nut_is_a_relation_too(flea: Actuator) -> None:
    row = ResidualSpec("heat", "junction", "W", junction="nut_node")
    assert value(parity_relation(flea, row), motion(P)) == pytest.approx(0.0, abs=1e-9)


def test_what_no_sensor_closes_is_named(flea: Actuator) -> None:
    row = ResidualSpec("heat", "junction", "W", junction="winding_node")
    with pytest.raises(ModelError, match=r"'winding_node'.*not measured; add a sensor"):
        parity_relation(flea, row)
    blind = flea.with_sensors(["motor_voltage", "motor_current"])
    with pytest.raises(ModelError, match=r"'shaft'.*not measured"):
        relation(blind, "parity_electrical")


def test_mechanical_relation_is_in_newtons_whatever_the_lead(flea: Actuator) -> None:
    """Only products with the screw ratio enter, so another lead gives the same residual."""
    other = flea.graph.values()
    for name, exponent in {
        "screw_ratio": 1,
        "torque_constant": 1,
        "back_emf_constant": 1,
        "screw_coulomb_friction": 1,
        "friction_smooth_speed": -1,
        "screw_viscous_friction": 2,
        "rotor_inertia": 2,
    }.items():
        other[name] *= 1.7**exponent
    rescaled = flea.with_parameters(other).with_sensors(FLEA)
    readings = {**motion(P), "motor_current": 1.7}
    for name in ("parity_mechanical", "parity_electrical"):
        before = value(relation(flea.with_sensors(FLEA), name), readings)
        assert value(relation(rescaled, name), readings) == pytest.approx(before, rel=1e-9)


@pytest.mark.parametrize(
    ("cause", "electrical", "mechanical"),
    [
        ("winding_resistance+", 1.3, 0.0),  # dR i
        ("back_emf_constant+", 40.0, 0.0),  # dK w
        ("torque_constant+", 0.0, -1.3),  # -dK i
        ("screw_coulomb_friction+", 0.0, 1.0),  # d tau s(w), saturated at 40 rad/s
        ("screw_viscous_friction+", 0.0, 40.0),  # dB w
    ],
)
def test_plant_fault_moves_a_relation_by_its_regressor(
    flea: Actuator, cause: str, electrical: float, mechanical: float
) -> None:
    """The plant has another parameter, the relation the nominal one."""
    name, size = cause[:-1], 1e-6
    readings = motion({**P, name: P[name] + size})
    model = flea.with_sensors(ENCODER)
    for residual, per_unit in (
        ("parity_electrical", electrical),
        ("parity_mechanical", mechanical / P["screw_ratio"]),
    ):
        made = relation(model, residual)
        assert value(made, readings) / size == pytest.approx(per_unit, rel=1e-5, abs=1e-3)
        point = {**readings, **made.nominal}

        regressor = float(evaluate(made.regressor(hypothesis(cause)), point))
        assert regressor == pytest.approx(per_unit, rel=1e-4, abs=1e-9)


@pytest.mark.parametrize(
    ("mode", "false", "electrical", "mechanical"),
    [
        ("bias", {"motor_current": 1.3 + 0.5}, -2.95 * 0.5, 176.7 * 0.5),
        ("scaling", {"motor_current": 1.3 * 1.2}, -2.95 * 0.26, 176.7 * 0.26),
        ("dead", {"motor_current": 0.0, "d_motor_current": 0.0}, 2.95 * 1.3, -176.7 * 1.3),
    ],
)
def test_current_sensor_fault_moves_both_relations_in_the_ratio_of_r_and_k(
    flea: Actuator, mode: str, false: dict[str, float], electrical: float, mechanical: float
) -> None:
    model = flea.with_sensors(ENCODER)
    readings = {**motion(P), "d_motor_current": 0.0}
    zero = value(relation(model, "parity_electrical"), readings)
    found = value(relation(model, "parity_electrical"), {**readings, **false}) - zero
    assert found == pytest.approx(electrical, rel=1e-3)
    found = value(relation(model, "parity_mechanical"), {**readings, **false})
    assert found == pytest.approx(mechanical, rel=1e-3)


def test_normalised_relation_takes_the_direction_of_motion(flea: Actuator) -> None:
    model = flea.with_sensors(FLEA)
    plain, normal = (relation(model, f"parity_mechanical{end}") for end in ("", "_dn"))
    for speed in (0.02, -0.02):
        readings = {**motion(P), "d_actuator_position": speed}
        assert value(normal, readings) == pytest.approx(np.sign(speed) * value(plain, readings))


def test_an_electrical_relation_takes_the_direction_of_the_shaft_not_of_the_current(
    flea: Actuator,
) -> None:
    """As the observer forms it: while the load drives the motor the two differ."""
    model = flea.with_sensors(FLEA)
    plain, normal = (relation(model, f"parity_electrical{end}") for end in ("", "_dn"))
    for speed in (0.02, -0.02):
        for current in (1.0, -1.0):
            readings = {**motion(P), "d_actuator_position": speed, "motor_current": current}
            assert value(normal, readings) == pytest.approx(np.sign(speed) * value(plain, readings))


def test_relation_works_on_arrays(flea: Actuator) -> None:
    made = relation(flea.with_sensors(ENCODER), "parity_electrical")
    one = motion(P)
    many = {name: np.full(7, one[name]) for name in made.arguments}
    assert made(many).shape == (7,)
    np.testing.assert_allclose(made(many, {"winding_resistance": 3.95}), -1.3, rtol=1e-6)


def test_drift_has_a_part_that_grows(flea: Actuator) -> None:
    made = relation(flea.with_sensors(FLEA), "parity_electrical")
    current = FaultHypothesis("motor_current", 1, "drift")
    position = FaultHypothesis("actuator_position", 1, "drift")
    warm = "(1 + copper_per_kelvin*(winding_temperature - winding_reference_temperature))"
    assert str(made.growth(current)) == f"-winding_resistance*{warm}"
    assert str(made.growth(position)) == "0"
    assert str(made.regressor(position)) == "-back_emf_constant/screw_ratio"
