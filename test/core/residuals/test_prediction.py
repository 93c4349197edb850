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

"""Predicted stores, compiled from the graph, against their equations written down by hand."""

from __future__ import annotations

import copy
from dataclasses import asdict, replace

import pytest
from support.models.hand_relations import HEATED_BY_HAND, Signals, channels_of, direction
from support.observed import flea_parameters
from support.places import SHIPPED_STANDS

from flea_diag.configuration.description import compiled_relations
from flea_diag.configuration.files import load_yaml
from flea_diag.core.bond_graph.actuator import actuator
from flea_diag.core.calibration.run_spread import tolerance_of
from flea_diag.core.residuals.prediction import lumped, prediction
from flea_diag.core.residuals.relation_compiler import relation_set
from flea_diag.core.residuals.relation_set import RelationSet
from flea_diag.core.residuals.thermal import CORRECTION_S
from flea_diag.core.symbolic.expression import derivative, evaluate, substitute
from flea_diag.errors import ConfigurationError, ModelError

DESCRIBED = load_yaml("actuator.yaml")
FLEA = actuator(DESCRIBED)
P = flea_parameters(
    current_offset_a=0.5,
    coulomb_friction_n=50.0,
    viscous_friction_n_s_per_m=900.0,
    load_friction_ratio=0.2,
    nut_heating_k_per_j=0.02,
    nut_cooling_s=240.0,
    encoder_m_per_rad=5e-4,
)
WARM = {"motor_temperature": 60.0, "nut_temperature": 31.0, "ambient_temperature": 24.0}


def moving(speed_m_s: float = 0.05) -> Signals:
    zero = dict.fromkeys(Signals._fields, 0.0)
    way = direction(P, speed_m_s)
    found = {"current_a": -2.0, "speed_m_s": speed_m_s, "position_rate_m_s": speed_m_s}
    return Signals(**{**zero, **found, "load_n": 300.0, "direction": way})


@pytest.mark.parametrize("encoder", [True, False])
@pytest.mark.parametrize("speed_m_s", [0.05, -0.05])
def test_rates_are_those_written_by_hand(encoder: bool, speed_m_s: float) -> None:
    known = compiled_relations("actuator.yaml", None, encoder)
    s = moving(speed_m_s)
    channels = {**channels_of(P, s), **WARM}
    found = {row.name: row.rate for row in known.predictions}
    assert list(found) == ["motor_temperature", "nut_temperature", "ambient_temperature"]
    values = {**channels, **{n: getattr(P, n) for n in known.parameters}}
    for name, rate in found.items():
        wanted = HEATED_BY_HAND[name](P, s, WARM)
        assert evaluate(rate, values) == pytest.approx(wanted, rel=1e-12), name
    x = [channels[name] for name in known.signals]
    supplied = known.functions["supplies"](P, x)
    assert supplied[0] == pytest.approx(0.010 * 2.5**2)
    assert supplied[1] == pytest.approx(0.02 * 50.0 * 0.05)


def test_one_node_of_winding_and_housing_in_physical_parameters() -> None:
    (spec,) = [row for row in FLEA.residuals.values() if row.name == "motor_temperature"]
    found = prediction(FLEA, spec)
    point = {**FLEA.graph.values(), **WARM, "motor_current": 2.0}
    # Share 1 of 2.95 ohm over 30 + 270 J/K; cooled through 2.6 K/W.
    wanted = (2.95 * 2.0**2 - (60.0 - 24.0) / 2.6) / 300.0
    assert evaluate(found.rate, point) == pytest.approx(wanted, rel=1e-12)


def test_lumped_stores_lose_the_path_between_them() -> None:
    graph = lumped(FLEA.graph, "housing_node", ("winding_mass", "housing_mass"))
    beside = {bond.other("housing_node") for bond in graph.at("housing_node")}
    assert {"winding_mass", "housing_mass", "winding_heat", "housing_to_ambient"} <= beside
    assert graph.at("winding_path") == graph.at("winding_node") == ()


def test_exchange_with_the_air_is_the_inverse_of_the_time_constant() -> None:
    known = compiled_relations("actuator.yaml")
    assert known.exchange_rate(P, "nut_temperature", "ambient_temperature") == 1.0 / 240.0
    assert known.exchange_rate(P, "ambient_temperature", "ambient_temperature") == 0.0
    assert known.exchange_rate(P, "nut_temperature", "motor_temperature") == 0.0


def bridged() -> dict:
    """The FLEA with a path for heat from the housing to the nut."""
    content = copy.deepcopy(DESCRIBED)
    content["parameters"]["bridge_resistance"] = {"value": 5.0, "unit": "K/W"}
    content["junctions"]["bridge"] = {"type": "1", "domain": "thermal"}
    element = {"type": "R", "parameters": {"resistance": "bridge_resistance"}}
    content["elements"]["bridge_path"] = element
    ends = ("housing_node -> bridge", "bridge -> bridge_path", "bridge -> nut_node")
    content["bonds"] += ends
    return content


def compiled(content: dict) -> RelationSet:
    model = actuator(content)
    held = {*model.base_parameters, *model.graph.parameters} - set(model.predicted)
    return relation_set(model, [], held, [])


def test_measured_neighbours_come_from_the_graph() -> None:
    known = compiled(bridged())
    motor, nut, _ = known.predictions
    assert set(motor.exchange) == {"nut_temperature", "ambient_temperature"}
    assert set(nut.exchange) == {"motor_temperature", "ambient_temperature"}
    values = dict.fromkeys(known.parameters, 1.0) | FLEA.graph.values()
    values |= {"bridge_resistance": 5.0, "nut_capacity_j_per_k": 60.0}
    values |= {"motor_capacity_j_per_k": 300.0}
    assert evaluate(motor.exchange["nut_temperature"], values) == pytest.approx(1 / (5.0 * 300.0))
    assert evaluate(nut.exchange["motor_temperature"], values) == pytest.approx(1 / (5.0 * 60.0))


def test_what_no_sensor_reads_is_not_predicted() -> None:
    """Without lumping, the winding's temperature would have to be known; without the current, too.

    What is left is predicted still.
    """
    content = copy.deepcopy(DESCRIBED)
    content["residuals"]["motor_temperature"].pop("lumped")
    assert [row.name for row in compiled(content).predictions] == [
        "nut_temperature",
        "ambient_temperature",
    ]
    known = compiled_relations("actuator.yaml", ("motor_temperature",))
    assert known.predictions == ()


def test_a_prediction_of_a_parameter_that_it_needs_itself_is_refused() -> None:
    content = copy.deepcopy(DESCRIBED)
    content["residuals"]["motor_temperature"].pop("neglected")
    with pytest.raises(ModelError, match="winding_temperature is predicted itself; name the para"):
        compiled(content)


@pytest.mark.parametrize(
    ("key", "names", "said"),
    [
        ("neglected", ["friction"], "neglected 'friction' is no parameter"),
        ("lumped", ["winding_path"], "lumped 'winding_path' is no store"),
        ("lumped", ["winding_mass"], "lumps winding_mass, none of them is where motor_temper"),
    ],
)
def test_mistakes_in_the_description_are_named(key: str, names: list[str], said: str) -> None:
    content = copy.deepcopy(DESCRIBED)
    content["residuals"]["motor_temperature"][key] = names
    with pytest.raises(ConfigurationError, match=said):
        actuator(content)


def test_a_reading_without_a_store_is_refused() -> None:
    content = copy.deepcopy(DESCRIBED)
    content["elements"].pop("inductance")
    content["bonds"].remove("armature -> inductance")
    content["parameters"].pop("winding_inductance")
    content["base_parameters"].pop("winding_inductance_h")
    content["residuals"]["parity_electrical"]["without"] = []
    model = actuator(content, sound=False)
    spec = replace(model.residuals["nut_temperature"], channel="motor_current")
    with pytest.raises(ModelError, match="no store at 'armature', where motor_current is read"):
        prediction(model, spec)


def test_nothing_is_left_of_the_assumed_capacities() -> None:
    known = compiled_relations("actuator.yaml")
    other = copy.deepcopy(DESCRIBED)
    other["parameters"]["winding_capacity"]["value"] = 77.0
    held = set(known.parameters)
    moved = relation_set(actuator(other), [], held, [])
    for one, two in zip(known.predictions, moved.predictions, strict=True):
        assert substitute(one.rate, {}) == two.rate


@pytest.mark.parametrize("stand", ["flea", "ema", "wing"])
def test_the_error_of_a_predicted_winding_is_small_beside_what_units_differ_by(stand):
    """Its variance needs no place in the weights: 0.2 % of that of the resistance at most."""
    known = compiled_relations(SHIPPED_STANDS[stand] / "actuator.yaml")
    circuit = known.named[known.residuals.circuit].expression
    p = replace(flea_parameters(), **known.described)
    point = {**asdict(p), **known.reference, "motor_current": 3.0, "motor_voltage": 5.0}
    spread = tolerance_of(p, known)
    error_k = spread.thermal_rate_k_per_s * CORRECTION_S
    (warm,) = known.predicted
    slopes = (derivative(circuit, name) for name in (warm, "winding_resistance_ohm"))
    by_kelvin, by_ohm = (float(evaluate(slope, point)) for slope in slopes)
    share = abs(by_kelvin * error_k / (by_ohm * spread.winding_resistance_ohm))
    assert 0.01 < share < 0.045
