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

"""Descriptions of actuators: the shipped ones, and everything wrong that one may hold."""

from __future__ import annotations

import copy
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from support import examples
from support.places import WING

from flea_diag.configuration.files import load_yaml
from flea_diag.core.bond_graph.actuator import Actuator, actuator
from flea_diag.core.causal_graph.operating_point import QUADRANTS, operating_values
from flea_diag.core.faults.fault import catalogue
from flea_diag.errors import ConfigurationError, FleaError, ModelError

FAULTS = [
    "jam",
    "spall",
    "ball_nut_friction",
    "backlash",
    "rotor_eccentricity",
    "winding_short",
    "winding_resistance_rise",
    "winding_open",
    "motor_failure",
    "supply_open",
    "supply_short",
    "supply_sag",
    "accelerometer_1_fault",
    "accelerometer_2_fault",
]
CHANNELS = [
    "motor_current",
    "motor_voltage",
    "motor_speed",
    "actuator_position",
    "load_position",
    "load_force",
    "motor_temperature",
    "nut_temperature",
    "ambient_temperature",
]
MODES = ["bias", "drift", "scaling", "dead", "noise", "dropout"]


@pytest.fixture
def description() -> dict[str, Any]:
    return copy.deepcopy(load_yaml("actuator.yaml"))


@pytest.fixture(scope="module")
def flea() -> Actuator:
    return actuator(load_yaml("actuator.yaml"))


def test_parameters_come_back_to_what_was_measured_in_linear_coordinates(flea: Actuator) -> None:
    p = flea.graph.values()
    rho = p["screw_ratio"]
    assert p["winding_resistance"] == 2.95
    assert p["back_emf_constant"] / rho == pytest.approx(176.6, abs=0.05)
    assert p["torque_constant"] / rho == pytest.approx(176.7, abs=0.05)
    assert p["screw_coulomb_friction"] / rho == pytest.approx(47, abs=0.05)
    assert p["screw_viscous_friction"] / rho**2 == pytest.approx(412, abs=0.5)
    assert 110 < p["rotor_inertia"] / rho**2 < 152
    capacity = p["winding_capacity"] + p["housing_capacity"]
    assert 300 <= capacity <= 317
    assert capacity * p["housing_ambient_resistance"] == pytest.approx(775, rel=0.02)


@pytest.mark.parametrize("quadrant", QUADRANTS, ids=str)
def test_operating_point_is_steady_and_holds_what_it_says(flea: Actuator, quadrant: Any) -> None:
    values = operating_values(flea, quadrant)
    assert values["motor_current"] == pytest.approx(quadrant.current * 1.0)
    assert values["motor_speed"] == pytest.approx(quadrant.speed * 60.0)
    assert values["e_rotor"] == 0.0
    assert values["e_inductance"] == 0.0
    power = values["motor_voltage"] * values["motor_current"]
    copper = 2.95 * 1.0
    shaft = values["e_motor_1"] * values["motor_current"]
    assert power == pytest.approx(copper + shaft)
    # Friction always takes power, whatever the direction.
    assert values["e_screw_friction"] * values["motor_speed"] > 0


def test_every_fault_id_is_in_the_catalogue(flea: Actuator) -> None:
    found = catalogue(load_yaml("faults.yaml"), flea)
    expected = {*FAULTS, *(f"{channel}_{mode}" for channel in CHANNELS for mode in MODES)}
    assert set(found) == expected
    assert str(found["jam"].alternatives[0][0]) == "screw_coulomb_friction+"
    assert str(found["motor_current_bias"].alternatives[1][0]) == "motor_current_bias-"


def test_another_actuator_needs_a_description_and_no_code() -> None:
    wing = actuator(load_yaml(WING))
    assert wing.causality.sound
    known = catalogue(load_yaml(WING.with_name("faults.yaml")), wing)
    assert {name for name in FAULTS if not name.startswith("accelerometer")} <= set(known)
    assert {"magnet_loss", "surface_angle_bias"} <= set(known)
    assert "nut_temperature_bias" not in known


def test_calibrated_values_replace_the_nominal_ones_and_are_checked(flea: Actuator) -> None:
    changed = flea.with_parameters({"winding_resistance": 3.3})
    assert changed.graph.values()["winding_resistance"] == 3.3
    assert flea.graph.values()["winding_resistance"] == 2.95
    with pytest.raises(ConfigurationError, match=r"winding_resistance' = -1.0 ohm must be"):
        flea.with_parameters({"winding_resistance": -1.0})
    with pytest.raises(ConfigurationError, match="no parameter 'resistance'"):
        flea.with_parameters({"resistance": 1.0})


def test_fewer_sensors_leave_the_residuals_that_they_can_feed(flea: Actuator) -> None:
    few = flea.with_sensors(["motor_current", "motor_voltage", "actuator_position"])
    assert "parity_kinematic" not in few.residuals
    assert "motor_current" not in few.residuals  # its model needs the measured load, too
    assert "parity_drive" in few.residuals


def bad(path: str, value: Any) -> Any:
    """An edit of a description: ``a.b.c`` set to a value, or removed with None."""

    def edit(content: dict[str, Any]) -> None:
        *parents, last = path.split(".")
        for key in parents:
            content = content[key]
        if value is None:
            del content[last]
        else:
            content[last] = value

    return edit


def add_bond(bond: str) -> Any:
    return lambda content: content["bonds"].append(bond)


def drop_bond(bond: str) -> Any:
    return lambda content: content["bonds"].remove(bond)


def second_mass(content: dict[str, Any]) -> None:
    content["parameters"]["nut_mass_kg"] = {"value": 1.0, "unit": "kg"}
    content["elements"]["ring"] = {"type": "I", "parameters": {"inertia": "nut_mass_kg"}}
    content["bonds"].append("nut -> ring")


def resistive_divider(content: dict[str, Any]) -> None:
    content["parameters"]["bleeder_ohm"] = {"value": 1.0, "unit": "ohm"}
    content["elements"]["cable"] = {"type": "R", "parameters": {"resistance": "bleeder_ohm"}}
    content["elements"]["bleeder"] = {"type": "R", "parameters": {"resistance": "bleeder_ohm"}}
    content["junctions"]["line"] = {"type": "1", "domain": "electrical"}
    content["bonds"] += ["line -> cable", "terminals -> bleeder", "line -> terminals"]
    content["bonds"].remove("supply -> terminals")
    content["bonds"].append("supply -> line")


WRONG = [
    (bad("parameters.rotor_inertia.value", -1e-5), "rotor_inertia.*> 0"),
    (bad("parameters.rotor_inertia.value", 0.0), "rotor_inertia.*> 0"),
    (bad("parameters.housing_capacity.value", float("nan")), "housing_capacity.*finite"),
    (bad("parameters.winding_inductance.unit", "mH"), "mH.*no prefixes"),
    (bad("parameters.winding_resistance.unit", "H"), "winding_resistance.*'H'.*ohm"),
    (bad("parameters.load_mass.value", "5e6"), r"load_mass.*value = '5e6'.*5.0e\+6"),
    (bad("parameters.load_mass", None), "load_mass.*not among the parameters"),
    (bad("sensors.motor_current.unit", "V"), "motor_current.*'V'.*reads A"),
    (bad("sensors.motor_current.noise", 0.0), "motor_current.*noise"),
    (bad("sensors.motor_current.at", "windings"), "motor_current.*'windings'.*no junction"),
    (bad("elements.rotor.type", "L"), "'rotor'.*unknown type 'L'"),
    (bad("elements.rotor.colour", "red"), "'rotor'.*unknown key 'colour'"),
    (bad("elements.winding.law", "ohmic"), "'winding'.*unknown law 'ohmic'"),
    (bad("elements.winding.law", "inertia"), "'winding'.*cannot have law"),
    (bad("elements.winding.parameters", {}), "'winding'.*needs"),
    (bad("elements.nut_heat.powers", ["rotor"]), "'nut_heat'.*'rotor'.*no R"),
    (bad("junctions.nut.domain", "optical"), "'optical'.*unknown"),
    (bad("junctions.nut.domain", "rotation"), "actuator_position.*'m'.*'nut' it reads"),
    (bad("junctions.coupling.domain", "rotation"), "load_cell -> coupling joins domains"),
    (bad("elements.rotor.state", "winding_resistance"), "'winding_resistance' is a parameter and"),
    (bad("elements.rotor.state", "x"), "state 'x' cannot be a name"),
    (bad("elements.rotor.state", "w = 1; y"), "'w = 1; y' cannot be a name"),
    (bad("elements.rotor.state", "lambda"), "'lambda' cannot be a name"),
    (bad("scan_period_s", 0.0), "scan_period_s"),
    (bad("scan_period_s", None), "scan_period_s is missing"),
    (bad("schema_version", 2), "schema_version = 2"),
    (bad("comment", "hello"), "unknown key 'comment'"),
    (bad("bonds", "none"), "bonds.*list"),
    (bad("inputs.commanded_load", None), "'commanded_load'.*no input"),
    (bad("inputs.wind", {"unit": "N"}), "'wind'.*no source"),
    (bad("residuals.motor_current.kind", "guess"), "'motor_current'.*'guess'"),
    (bad("residuals.motor_current.model", "ideal"), "no model 'ideal'"),
    (bad("residuals.parity_electrical.junction", "rotor"), "'rotor' is no junction"),
    (bad("residuals.parity_load.unit", "V"), "parity_load.*'V'"),
    (bad("models.driven.measured", ["motor_power"]), "'motor_power'.*no sensor"),
    (bad("models.driven.measured", ["load_position"]), "'load_position'.*integral"),
    (bad("operating_point.by", ["commanded_voltage"]), "one input for each value"),
    (bad("operating_point.by", ["commanded_voltage", "zeta"]), "'zeta', no input or state; known"),
    (add_bond("shaft -> flywheel"), "dangling.*'flywheel'"),
    (add_bond("shaft = rotor"), "'shaft = rotor'.*tail -> head"),
    (add_bond("shaft -> rotor"), "'rotor'"),
    (add_bond("winding -> rotor"), "junction at neither end"),
    (drop_bond("shaft -> rotor"), "'rotor' has 0 bonds"),
    (second_mass, "'load_inertia'|'ring'|'rotor'.*derivative causality"),
    (resistive_divider, "algebraic loop"),
]


@pytest.mark.parametrize(("edit", "message"), WRONG, ids=[m for _, m in WRONG])
def test_what_is_wrong_is_refused_by_name(
    description: dict[str, Any], edit: Any, message: str
) -> None:
    edit(description)
    with pytest.raises((ConfigurationError, ModelError), match=message) as caught:
        actuator(description)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("content", [None, [], "text", 3, {}, {"schema_version": 1}])
def test_what_is_no_description_is_refused(content: Any) -> None:
    with pytest.raises(ConfigurationError, match=r"actuator\.yaml"):
        actuator(content)


def test_half_arrow_of_a_passive_element_must_point_to_it(description: dict[str, Any]) -> None:
    description["bonds"].remove("armature -> winding")
    description["bonds"].append("winding -> armature")
    with pytest.raises(ModelError, match=r"'winding'.*armature -> winding"):
        actuator(description)


SIZE = {"name": "drag", "unit": "N", "moves": {"coulomb_friction_n": 1}}


@pytest.mark.parametrize(
    ("edit", "message"),
    [
        (bad("faults.jam.hypotheses", [["screw_drag+"]]), r"'jam'.*screw_drag\+"),
        (bad("faults.jam.hypotheses", [["screw_ratio"]]), "'jam'.*must end in"),
        (bad("faults.jam.onset", "sudden"), "jam: onset = 'sudden' is unknown"),
        (bad("faults.jam.size", -1.0), "jam: size = -1.0 must be above 0"),
        (bad("faults.jam.severity", 3), "jam: unknown key 'severity'"),
        (bad("sensor_modes.stuck", {"approach": "physics", "onset": "abrupt"}), "'stuck'"),
        (bad("sensor_errors.motor_torque", {"bias": 1.0}), "sensor_errors: 'motor_torque' is no"),
        (bad("sensor_errors.motor_current.ages_s", [0.0]), r"ages_s\[0\] = 0.0 must be above 0"),
        (bad("faults.spall.effects", [{"sizes": []}]), "'spall': effect 1: sizes is empty"),
        (
            bad("faults.spall.effects", [{"sizes": [{"name": "drag", "unit": "N"}]}]),
            "'drag' moves nothing; give moves, scales, opens or adds",
        ),
        (
            bad("faults.spall.effects", [{"sizes": [{**SIZE, "moves": {"screw_drag": 1}}]}]),
            "moves: 'screw_drag' is no base parameter of the description, known are force",
        ),
        (
            bad("faults.spall.effects", [{"sizes": [{**SIZE, "opens": ["the winding"]}]}]),
            "opens: 'the winding' is no parameter of the description",
        ),
        (
            bad("faults.spall.effects", [{"sizes": [{**SIZE, "adds": {"parity_x": "direction"}}]}]),
            "adds: 'parity_x' is no residual of the description",
        ),
        (
            bad("faults.spall.effects", [{"sizes": [{**SIZE, "low": 3.0, "high": 2.0}]}]),
            "low = 3.0 must be at most high = 2.0",
        ),
        (
            bad("faults.spall.effects", [{"sizes": [{**SIZE, "limit": 0.0}]}]),
            "limit = 0.0, the size at the end of life, must be above 0",
        ),
    ],
)
def test_a_wrong_fault_is_refused_by_name(flea: Actuator, edit: Any, message: str) -> None:
    content = copy.deepcopy(load_yaml("faults.yaml"))
    edit(content)
    with pytest.raises(ConfigurationError, match=message):
        catalogue(content, flea)


JUNK = st.one_of(
    st.none(),
    st.booleans(),
    st.integers(-3, 10**30),
    st.floats(allow_nan=True, allow_infinity=True),
    st.sampled_from(["", "x", "motor_current", "shaft", "ohm", "N*m", "->", "a -> b", "MSe", "0"]),
    st.lists(st.sampled_from(["shaft", 3, None]), max_size=2),
    st.dictionaries(st.sampled_from(["type", "unit", 7]), st.just("I"), max_size=2),
)


def places(content: Any, path: tuple[Any, ...] = ()) -> list[tuple[Any, ...]]:
    """Every place in a nested description."""
    found = [path] if path else []
    keys = content if isinstance(content, dict) else range(len(content))
    for key in keys if isinstance(content, (dict, list)) else ():
        inner = content[key]
        found += places(inner, (*path, key)) if isinstance(inner, (dict, list)) else [(*path, key)]
    return found


FILES = {name: load_yaml(name) for name in ("actuator.yaml", "faults.yaml")}
PLACES = {name: places(content) for name, content in FILES.items()}


@pytest.mark.slow
@given(st.sampled_from(sorted(FILES)), st.data())
@settings(max_examples=examples(300), deadline=None)
def test_any_junk_anywhere_is_taken_or_refused_in_one_line(name: str, data: st.DataObject) -> None:
    content = copy.deepcopy(FILES[name])
    *parents, last = data.draw(st.sampled_from(PLACES[name]))
    place = content
    for key in parents:
        place = place[key]
    place[last] = data.draw(JUNK)
    assert "\n" not in refusal(name, content)


def refusal(name: str, content: Any) -> str:
    """Why a description is refused, empty when it is taken; anything but a FleaError escapes."""
    try:
        if name == "faults.yaml":
            catalogue(content, _FLEA)
        else:
            actuator(content).state_space("stand")
    except FleaError as error:
        return str(error)
    return ""


_FLEA = actuator(FILES["actuator.yaml"])
