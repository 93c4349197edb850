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

"""Signatures against exact derivatives of equations written by hand, in all four quadrants."""

from __future__ import annotations

import dataclasses
from fractions import Fraction

import pytest
from support.models import ema_oracle as oracle
from support.places import SHIPPED_STANDS

from flea_diag.configuration.files import load_yaml
from flea_diag.core.bond_graph.actuator import Actuator, actuator
from flea_diag.core.causal_graph.operating_point import QUADRANTS, Quadrant
from flea_diag.core.faults.fault import Fault, catalogue, hypothesis
from flea_diag.core.signatures.diagnosability import usable_residuals
from flea_diag.core.signatures.signature import signature_table

STEP = Fraction(1, 100)
UP, DOWN = 1 + STEP, 1 - STEP
MOTORING = (Quadrant(1, 1), Quadrant(-1, -1))

# Row -> deviating parameters, and what the row reads while motoring outward against the load
# (current, speed, actuator position, load position, force, motor and nut temperature), as
# published for this class of actuator: magnitude, slope, order of the first effect.
ROWS = {
    "R+": (
        ["winding_resistance+"],
        "0-(1) 0-(2) 0-(3) 0-(4) 0-(2) 0+(2) 0-(3)",
    ),
    "R-": (
        ["winding_resistance-"],
        "0+(1) 0+(2) 0+(3) 0+(4) 0+(2) 0-(2) 0+(3)",
    ),
    "short": (
        [
            "winding_resistance-",
            "torque_constant-",
            "back_emf_constant-",
            "winding_inductance-",
        ],
        "0+(1) 0-(1) 0-(2) 0-(3) 0-(1) 0-(2) 0-(2)",
    ),
    "K-": (
        ["torque_constant-", "back_emf_constant-"],
        "0+(1) 0-(1) 0-(2) 0-(3) 0-(1) 0+(3) 0-(2)",
    ),
    "Kt-": (["torque_constant-"], "0+(2) 0-(1) 0-(2) 0-(3) 0-(1) 0+(4) 0-(2)"),
    "B+": (["screw_viscous_friction+"], "0+(2) 0-(1) 0-(2) 0-(3) 0-(1) 0+(4) 0+(1)"),
    "tau+": (["screw_coulomb_friction+"], "0+(2) 0-(1) 0-(2) 0-(3) 0-(1) 0+(4) 0+(1)"),
    "K_l-": (["coupling_stiffness-"], "0-(2) 0+(1) 0+(2) 0-(2) -+(0) 0-(4) 0+(2)"),
    "load+": (["commanded_load+"], "0+(3) 0-(2) 0-(3) 0-(2) 0+(1) 0+(5) 0-(3)"),
    "R_l+": (["load_friction+"], "0+(3) 0-(2) 0-(3) 0-(2) 0+(1) 0+(5) 0-(3)"),
    "V-": (["drive_gain-"], "0-(1) 0-(2) 0-(3) 0-(4) 0-(2) 0-(3) 0-(3)"),
    "R_ha+": (["housing_ambient_resistance+"], "00 00 00 00 00 0+(1) 00"),
    "R_na+": (["nut_ambient_resistance+"], "00 00 00 00 00 00 0+(1)"),
}


@pytest.fixture(scope="module")
def stand() -> Actuator:
    """The shipped actuator with every prediction made by the whole stand."""
    made = actuator(load_yaml("actuator.yaml"))
    whole = {
        name: dataclasses.replace(spec, model="stand") if spec.model else spec
        for name, spec in made.residuals.items()
    }
    return dataclasses.replace(made, residuals=whole)


def fault(name: str, words: list[str], onset: str = "abrupt") -> Fault:
    group = tuple(hypothesis(word) for word in words)
    return Fault(name, "", (group,), "physics", onset, 0.2, False, "")


FAULTS = {name: fault(name, words) for name, (words, _) in ROWS.items()}


def exact_cells(row: str, quadrant: Quadrant, weight: dict[str, int]) -> dict[str, str]:
    """Cells of a row by exact power series, each deviation of a relative size STEP * weight."""
    changes, extra = {}, {}
    for word in ROWS[row][0]:
        name, sense = word[:-1], 1 if word[-1] == "+" else -1
        if name in oracle.PARAMETERS:
            changes[name] = 1 + sense * STEP * weight.get(name, 1)
        else:
            extra[name] = Fraction(sense)
    found = oracle.deviation((quadrant.current, quadrant.speed), changes, extra)
    return {channel: oracle.cell(signs) for channel, signs in found.items()}


def test_table_while_motoring_is_the_published_one(stand: Actuator) -> None:
    table = signature_table(stand, FAULTS, oracle.CHANNELS, QUADRANTS[0])
    for name, (_, words) in ROWS.items():
        assert " ".join(str(table[name][c]) for c in oracle.CHANNELS) == words, name


@pytest.mark.slow
@pytest.mark.parametrize("quadrant", QUADRANTS, ids=str)
def test_every_cell_is_the_exact_derivative(stand: Actuator, quadrant: Quadrant) -> None:
    table = signature_table(stand, FAULTS, oracle.CHANNELS, quadrant)
    open_cells = set()
    for name in ROWS:
        exact = exact_cells(name, quadrant, {})
        for channel in oracle.CHANNELS:
            found = str(table[name][channel])
            if "*" in found:
                open_cells.add((name, channel))
            else:
                assert found == exact[channel], (name, channel)
    # A winding short while braking is the only row whose deviations pull against each other.
    assert open_cells == (set() if quadrant in MOTORING else {("short", "motor_current")})


@pytest.mark.parametrize("quadrant", [q for q in QUADRANTS if q not in MOTORING], ids=str)
def test_an_open_cell_does_go_either_way(quadrant: Quadrant) -> None:
    mostly_copper = exact_cells("short", quadrant, {"winding_resistance": 20})
    mostly_field = exact_cells("short", quadrant, {"back_emf_constant": 20})
    assert {mostly_copper["motor_current"], mostly_field["motor_current"]} == {"0+(1)", "0-(1)"}


def test_paths_lead_from_the_parameter_to_the_channel(stand: Actuator) -> None:
    path = signature_table(stand, FAULTS, oracle.CHANNELS, QUADRANTS[0])["R+"]["motor_current"].path
    assert path.startswith("winding_resistance+ -> e_winding+ -> e_inductance- -> i-")
    assert path.endswith("motor_current-")


def test_incipient_fault_is_the_integral_of_the_abrupt_one(stand: Actuator) -> None:
    slow = {"K_l-": fault("K_l-", ["coupling_stiffness-"], "incipient")}
    table = signature_table(stand, slow, oracle.CHANNELS, QUADRANTS[0])
    assert str(table["K_l-"]["load_force"]) == "0-(1)"
    assert str(table["K_l-"]["motor_speed"]) == "0+(2)"


@pytest.fixture(scope="module")
def shipped() -> Actuator:
    return actuator(load_yaml("actuator.yaml"))


@pytest.fixture(scope="module")
def faults(shipped: Actuator) -> dict[str, Fault]:
    return catalogue(load_yaml("faults.yaml"), shipped)


def directions(shipped: Actuator, faults: dict[str, Fault], name: str, quadrant: Quadrant) -> str:
    """Direction of one alternative (the first) in r1, r2, r3 and r7."""
    columns = ["parity_electrical", "parity_mechanical", "parity_kinematic", "parity_drive"]
    (first, *_) = signature_table(shipped, {name: faults[name]}, columns, quadrant, 0.01).variants[
        name
    ]
    return " ".join(first.row[c].direction for c in columns)


# Signs published for a steady outward ramp: electrical, mechanical, kinematic, drive. Sensor
# rows are those of a positive bias and a positive scaling error (the published encoder and
# position rows have the opposite sense of error, so opposite signs).
@pytest.mark.parametrize(
    ("name", "expected"),
    [
        ("motor_current_bias", "- + 0 0"),
        ("motor_speed_scaling", "- - 0 0"),
        ("load_position_bias", "0 0 - 0"),
        ("actuator_position_bias", "0 0 + 0"),
        ("jam", "0 + 0 0"),
        ("motor_voltage_bias", "+ 0 0 +"),
        ("load_force_bias", "0 - 0 0"),
        ("supply_open", "0 0 * -"),
    ],
)
def test_parity_columns(
    shipped: Actuator, faults: dict[str, Fault], name: str, expected: str
) -> None:
    found = directions(shipped, faults, name, QUADRANTS[0]).split()
    wanted = expected.split()
    assert [f for f, w in zip(found, wanted, strict=True) if w != "*"] == [
        w for w in wanted if w != "*"
    ]


@pytest.mark.slow
def test_direction_normalised_relation_keeps_the_sign_of_friction_and_loses_that_of_bias(
    shipped: Actuator, faults: dict[str, Fault]
) -> None:
    def signs(fault_id: str, residual: str) -> list[str]:
        rows = {fault_id: faults[fault_id]}
        tables = [signature_table(shipped, rows, [residual], q) for q in QUADRANTS]
        return [t.variants[fault_id][0].row[residual].direction for t in tables]

    assert signs("jam", "parity_mechanical") == ["+", "+", "-", "-"]
    assert signs("jam", "parity_mechanical_dn") == ["+", "+", "+", "+"]
    assert signs("motor_current_bias", "parity_mechanical") == ["+", "+", "+", "+"]
    assert signs("motor_current_bias", "parity_mechanical_dn") == ["+", "+", "-", "-"]


@pytest.mark.parametrize("quadrant", QUADRANTS, ids=str)
def test_a_drift_keeps_its_slope_only_where_motion_does_not_turn_its_effect_round(
    shipped: Actuator, faults: dict[str, Fault], quadrant: Quadrant
) -> None:
    # e = d t moves the relation by K d t, ever growing; times the sign of the speed it is
    # turned round at each reversal, so that its change over two seconds has either sign.
    rows = {"motor_current_drift": faults["motor_current_drift"]}
    names = ("parity_mechanical", "parity_mechanical_dn")
    table = signature_table(shipped, rows, names, quadrant, 0.01)
    found = [variant.row for variant in table.variants["motor_current_drift"]]
    assert [row["parity_mechanical"].symbols for row in found] == ["0+", "0-"]
    assert [row["parity_mechanical_dn"].slope for row in found] == ["*", "*"]


@pytest.mark.parametrize("name", ["winding_open", "motor_failure"])
def test_a_motor_that_draws_nothing_may_bring_the_drive_nearer_to_its_command(
    shipped: Actuator, faults: dict[str, Fault], name: str
) -> None:
    rows = {name: faults[name]}
    for quadrant, sign in zip(QUADRANTS[:3:2], "+-", strict=True):
        table = signature_table(shipped, rows, ("parity_drive",), quadrant, 0.01)
        found = [variant.row["parity_drive"] for variant in table.variants[name]]
        assert {cell.direction for cell in found if cell.affected} == {sign}


def test_sensor_fault_moves_its_own_residual_and_the_relations_that_read_it(
    shipped: Actuator, faults: dict[str, Fault]
) -> None:
    names = usable_residuals(shipped)
    rows = signature_table(shipped, faults, names, QUADRANTS[0], 0.01)
    moved = {n for n in names if rows["actuator_position_bias"][n].affected}
    assert moved == {"actuator_position", "parity_kinematic"}
    moved = {n for n in names if rows["motor_temperature_drift"][n].affected}
    assert moved == {"motor_temperature"}


def test_faulty_input_moves_the_prediction_the_other_way(
    shipped: Actuator, faults: dict[str, Fault]
) -> None:
    rows = {"motor_voltage_bias": faults["motor_voltage_bias"]}
    names = ["motor_speed", "motor_current"]
    up = signature_table(shipped, rows, names, QUADRANTS[0]).variants["motor_voltage_bias"][0]
    assert str(up.hypotheses[0]) == "motor_voltage_bias+"
    # The model runs faster than the plant: y minus its prediction falls.
    assert {name: str(up.row[name]) for name in names} == {
        "motor_speed": "0-(2)",
        "motor_current": "0-(1)",
    }


def test_merged_row_keeps_a_direction_that_all_alternatives_share(
    shipped: Actuator, faults: dict[str, Fault]
) -> None:
    rows = signature_table(shipped, faults, ["parity_mechanical", "motor_current"], QUADRANTS[0])
    assert rows["spall"]["parity_mechanical"].symbols == "+*"
    assert rows["motor_current_bias"]["motor_current"].magnitude == "*"
    assert not rows["rotor_eccentricity"]["motor_current"].affected


def test_a_braking_motor_says_nothing_of_the_sign_of_its_voltage() -> None:
    """Slow, the resistance takes more of it than the back-EMF gives; fast, it is the other way."""
    stand = SHIPPED_STANDS["ema"]
    model, found = actuator(load_yaml(stand / "actuator.yaml")), {}
    faults = catalogue(load_yaml(stand / "faults.yaml"), model)
    sag = {"supply_sag": faults["supply_sag"]}
    for quadrant in QUADRANTS:
        table = signature_table(model, sag, ["parity_drive"], quadrant, model.scan_period_s)
        found[quadrant.current, quadrant.speed] = table["supply_sag"]["parity_drive"].direction
    assert found == {(1, 1): "-", (-1, -1): "+", (-1, 1): "*", (1, -1): "*"}
