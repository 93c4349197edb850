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

"""What is compiled from the FLEA's graph, held against its relations written down by hand."""

from __future__ import annotations

from dataclasses import fields, replace
from types import SimpleNamespace

import numpy as np
import pytest
import yaml
from hypothesis import given
from hypothesis import strategies as st
from support.models.hand_relations import BY_HAND, Signals, channels_of, direction
from support.observed import flea_parameters
from support.places import WING

from flea_diag.configuration import description, files
from flea_diag.configuration.calibrations import learned
from flea_diag.configuration.description import compiled_relations
from flea_diag.configuration.knowledge import relations
from flea_diag.configuration.stand import load_stand
from flea_diag.core.bond_graph.actuator import actuator
from flea_diag.core.observers.observer_noise import ObserverNoise
from flea_diag.core.residuals.parameters import (
    LATER_TOLERANCES,
    UNIT_PARAMETERS,
    ActuatorParameters,
)
from flea_diag.core.residuals.parity import parity_relation
from flea_diag.core.residuals.relation_compiler import relation_set
from flea_diag.core.residuals.relation_set import RelationSet
from flea_diag.core.symbolic.collect import collect
from flea_diag.core.symbolic.expression import derivative, evaluate, symbols
from flea_diag.errors import ConfigurationError

FLEA = compiled_relations("actuator.yaml").residuals

CHANNELS = (
    "commanded_voltage",
    "motor_current",
    "motor_voltage",
    "motor_speed",
    "actuator_position",
    "load_position",
    "load_force",
    "motor_temperature",
)
P = flea_parameters(
    force_constant_n_per_a=100.0,
    back_emf_v_s_per_m=200.0,
    winding_resistance_ohm=2.0,
    current_offset_a=0.5,
    voltage_offset_v=1.0,
    coulomb_friction_n=10.0,
    viscous_friction_n_s_per_m=200.0,
    load_friction_ratio=0.1,
    reflected_mass_kg=50.0,
    drive_gain=0.9,
    drive_offset_v=0.2,
    position_offset_m=0.001,
    encoder_m_per_rad=5e-4,
)
ZERO = dict.fromkeys(Signals._fields, 0.0)
ENCODER = description.compiled_relations("actuator.yaml", CHANNELS, True)
SLOPE = description.compiled_relations("actuator.yaml", CHANNELS, False)
VARIANTS = {"encoder": ENCODER, "slope of the position": SLOPE}


def signals(**values: float) -> Signals:
    way = direction(P, values.get("speed_m_s", 0.0))
    return Signals(**{**ZERO, "direction": way, **values})


MOVING = signals(
    current_a=2.0,
    voltage_v=16.0,
    commanded_voltage_v=15.0,
    speed_m_s=0.05,
    acceleration_m_s2=0.4,
    load_n=-40.0,
    position_m=0.031,
    load_position_m=0.027,
    encoder_speed_rad_s=110.0,
    position_rate_m_s=0.05,
)


def computed(known: RelationSet, p: ActuatorParameters, channels: dict[str, float]) -> dict:
    """Values of the relations, by name."""
    x = [channels[name] for name in known.signals]
    return dict(zip(known.names, known.functions["relations"](p, x), strict=True))


def test_worked_values():
    found = computed(ENCODER, P, {**channels_of(P, MOVING), "motor_speed": 110.0})
    # By the encoder's 0.055 m/s: 150 N of motor force + 40 of the load helping - (10 + 0.1 * 40)
    # - 200 * 0.055 - 50 * 0.4
    assert found["parity_mechanical"] == pytest.approx(150 + 40 - 14 - 11 - 20)
    # 16 - 1 - 2 * 1.5 - 200 * 0.055
    assert found["parity_electrical"] == pytest.approx(1.0)
    assert found["parity_drive"] == pytest.approx(16.0 - 0.2 - 13.5)
    assert found["parity_kinematic"] == pytest.approx(0.003)
    assert found["parity_speed"] == pytest.approx(0.055 - 0.05)


def test_a_hot_winding_drops_more_voltage():
    cold, hot = (
        computed(SLOPE, P, channels_of(P, MOVING, degc))["parity_electrical"]
        for degc in (25.0, 125.0)
    )
    # Copper: 39.3 % more over 100 K, of a 3 V drop.
    assert hot - cold == pytest.approx(-3.0 * 0.393)


numbers = st.tuples(
    st.floats(-3, 3),
    st.floats(-24, 24),
    st.floats(-0.1, 0.1),
    st.floats(-3, 3),
    st.floats(-500, 500),
    st.floats(20, 120),
)


@pytest.mark.parametrize("variant", VARIANTS)
@given(numbers)
def test_what_is_drawn_is_what_was_written_by_hand(variant, drawn):
    amps, volts, speed, rate, load, degc = drawn
    known = VARIANTS[variant]
    s = signals(
        current_a=amps,
        voltage_v=volts,
        commanded_voltage_v=0.9 * volts,
        speed_m_s=speed,
        position_rate_m_s=speed,
        encoder_speed_rad_s=speed / 5e-4,
        acceleration_m_s2=rate,
        load_n=load,
        position_m=0.03,
        load_position_m=0.02,
    )
    found = computed(known, P, channels_of(P, s, degc))
    assert set(found) == set(BY_HAND) - ({"parity_speed"} if known is SLOPE else set())
    for name, value in found.items():
        assert value == pytest.approx(BY_HAND[name](P, s, degc), rel=1e-9, abs=1e-9), name


TERMS = {
    "parity_mechanical": {
        "motor_current": "force_constant_n_per_a",
        "1": "-force_constant_n_per_a*current_offset_a",
        "d_d_actuator_position": "-reflected_mass_kg",
        "direction": "-coulomb_friction_n",
        "fabs(load_force)*direction": "-load_friction_ratio",
        "d_actuator_position": "-viscous_friction_n_s_per_m",
        "load_force": "-1",
    },
    "parity_drive": {
        "motor_voltage": "1",
        "commanded_voltage": "-drive_gain",
        "1": "-drive_offset_v",
    },
    "parity_kinematic": {
        "actuator_position": "1",
        "load_position": "-1",
        "1": "-position_offset_m",
    },
}


@pytest.mark.parametrize("name", TERMS)
def test_terms_are_what_recordings_identify(name):
    (row,) = [row for row in SLOPE.relations if row.name == name]
    terms = collect(row.expression, row.signals)
    assert {str(basis): str(factor) for basis, factor in terms.items()} == TERMS[name]


def test_without_an_encoder_the_lead_of_the_screw_cancels_out():
    used = {name for row in SLOPE.relations for name in symbols(row.expression)}
    assert "encoder_m_per_rad" not in used
    assert not used & {"screw_ratio", "torque_constant", "rotor_inertia"}


@pytest.mark.parametrize("variant", VARIANTS)
def test_spreads_are_the_differences_of_the_relations(variant):
    known = VARIANTS[variant]
    channels = channels_of(P, MOVING, 60.0)
    x = [channels[name] for name in known.signals]
    claimed = dict(zip(known.differing, known.functions["spreads"](P, x), strict=True))
    assert list(claimed) == ["parity_mechanical", "parity_electrical"]
    for name, row in claimed.items():
        for parameter, found in zip(UNIT_PARAMETERS, row, strict=True):
            if parameter in LATER_TOLERANCES:
                assert found == 0.0  # units are alike in it unless the description says more
                continue
            step = 1e-3
            up, down = (
                computed(known, replace(P, **{parameter: getattr(P, parameter) + h}), channels)
                for h in (step, -step)
            )
            measured = (up[name] - down[name]) / (2 * step)
            assert found == pytest.approx(measured, rel=1e-6, abs=1e-6), parameter


def test_push_and_dry_friction_make_up_the_relation():
    channels = channels_of(P, MOVING)
    x = [channels[name] for name in SLOPE.signals]
    push, dry = SLOPE.functions["drag"](P, x)
    assert dry == pytest.approx(10.0 + 0.1 * 40.0)
    viscous = 200.0 * 0.05
    whole = computed(SLOPE, P, channels)["parity_mechanical"]
    assert push - viscous - dry * channels["direction"] == pytest.approx(whole)


@pytest.mark.parametrize(
    ("name", "channel"),
    [
        ("parity_mechanical", "motor_current"),
        ("parity_mechanical", "load_force"),
        ("parity_electrical", "motor_voltage"),
        ("parity_drive", "commanded_voltage"),
        ("parity_kinematic", "load_position"),
        ("parity_speed", "motor_speed"),
    ],
)
def test_without_a_signal_there_is_no_residual(name, channel):
    whole = channels_of(P, MOVING)
    assert np.isfinite(computed(ENCODER, P, whole)[name])
    assert np.isnan(computed(ENCODER, P, {**whole, channel: float("nan")})[name])


def test_columns_and_single_scans_give_the_same_bits():
    random = np.random.default_rng(3)
    columns = {name: random.normal(1.0, 0.5, 50) for name in ENCODER.signals}
    many = computed(ENCODER, P, columns)
    for k in range(50):
        one = computed(ENCODER, P, {name: float(c[k]) for name, c in columns.items()})
        assert all(one[name] == many[name][k] for name in one)


@pytest.mark.parametrize("wing", [False, True])
def test_any_description_compiles(wing):
    """In its own parameters where it names no base parameters, with a shape for every width."""
    content = files.load_yaml(WING if wing else "actuator.yaml")
    if wing:
        del content["base_parameters"], content["tolerances"]
    model = actuator(content)
    rows = [row for row in model.residuals.values() if not row.predicts]
    names = [row.name for row in rows if not row.normalised]
    held = (set(model.base_parameters) | set(model.graph.parameters)) - set(model.predicted)
    known = relation_set(model, names, held, [])
    p = SimpleNamespace(**model.graph.values())
    for name, definition in model.base_parameters.items():
        setattr(p, name, evaluate(definition, model.graph.values()))
    random = np.random.default_rng(5)
    for row in known.relations:
        relation = parity_relation(model, model.residuals[row.name])
        readings = {name: float(random.normal()) for name in known.signals}
        given = {name: readings.get(name, 0.3) for name in relation.arguments}
        given |= {name: readings[name] for name in model.predicted if name in readings}
        shapes = {
            name: float(evaluate(shape, {**vars(p), **readings}))
            for name, shape in known.shapes.items()
        }
        x = [{**readings, **shapes}[name] for name in known.signals]
        value = dict(zip(known.names, known.functions["relations"](p, x), strict=True))[row.name]
        assert value == pytest.approx(float(relation({**given})), rel=1e-9, abs=1e-9), row.name


@pytest.mark.parametrize(("stand", "inductance_h"), [("flea", 2.0e-3), ("ema", 1.0e-3)])
def test_a_calibration_starts_from_the_inductance_that_the_stand_describes(stand, inductance_h):
    drawn = compiled_relations(load_stand(stand).actuator)
    assert drawn.described["winding_inductance_h"] == inductance_h


def test_a_parameter_that_no_calibration_holds_keeps_the_description_s_value():
    held = [entry.name for entry in fields(ActuatorParameters)]
    model = actuator(files.load_yaml("actuator.yaml"))
    known = relation_set(model, FLEA.relations, held, UNIT_PARAMETERS)
    (electrical,) = [row for row in known.relations if row.name == "parity_electrical"]
    assert "copper_per_kelvin" not in symbols(electrical.expression)
    slope = derivative(electrical.expression, "winding_temperature")
    point = {"winding_resistance_ohm": 2.0, "motor_current": 1.5, "current_offset_a": 0.5}
    assert evaluate(slope, point) == pytest.approx(-2.0 * 0.00393)


def test_a_description_that_lacks_an_identified_parameter_is_refused(tmp_path):
    described = files.load_yaml("actuator.yaml")
    described["sensors"]["motor_current"].pop("offset")
    for section in ("base_parameters", "tolerances"):
        described[section].pop("current_offset_a")
    path = tmp_path / "mine.yaml"
    path.write_text(yaml.safe_dump(described))
    calibration = learned(load_stand())
    with pytest.raises(ConfigurationError, match=r"mine\.yaml: no relation holds current_offset_a"):
        relations(load_stand(actuator=path), calibration)


def test_a_calibration_with_limits_of_what_the_description_lacks_is_refused():
    calibration = learned(load_stand())
    named = (replace(calibration.limits[0], name="parity_magic"), *calibration.limits[1:])
    with pytest.raises(ConfigurationError, match="limits of 'parity_magic', which is no residual"):
        relations(load_stand(), replace(calibration, limits=named))


def test_readings_enter_the_residuals_in_which_units_differ_with_their_zeros():
    stand = load_stand()
    calibration = learned(stand)
    terms = relations(stand, calibration).reading_terms(calibration.parameters)
    found = {(term.residual, term.channel): term.zero for term in terms}
    p = calibration.parameters
    assert found["parity_mechanical", "motor_current"] == p.current_offset_a
    assert found["parity_mechanical", "load_force"] == 0.0
    assert found["parity_electrical", "motor_voltage"] == p.voltage_offset_v
    assert not [residual for residual, _ in found if residual.endswith("_dn")]


def test_a_drive_follows_its_supply_and_has_no_coefficient_of_its_unit():
    stand = load_stand("ema")
    calibration = learned(stand)
    known = relations(stand, calibration)
    terms = known.reading_terms(calibration.parameters)
    assert "parity_drive" in known.differing
    assert {"parity_mechanical", "parity_electrical"} <= {term.residual for term in terms}
    assert "parity_drive" not in {term.residual for term in terms}
    units = {UNIT_PARAMETERS[k] for term in terms for k in term.units}
    assert {"winding_resistance_ohm", "coulomb_friction_n"} <= units
    assert "drive_gain" not in units


def test_a_coefficient_on_what_the_residual_does_not_read_is_refused():
    calibration = learned(load_stand())
    shift = replace(calibration.shifts[0], name="parity_mechanical", along="motor_voltage")
    made = replace(calibration, shifts=(*calibration.shifts, shift))
    assert made.mean_shifts == calibration.shifts
    with pytest.raises(ConfigurationError, match="along 'motor_voltage', which it does not read"):
        relations(load_stand(), made)


def test_noise_and_limits_of_a_channel_that_nobody_knows_are_refused():
    calibration = learned(load_stand())
    noise = ObserverNoise.of(calibration.observer_noise.to_mapping() | {"motor_curent_a": 0.1})
    with pytest.raises(ConfigurationError, match="observer_noise: 'motor_curent_a' is of no chann"):
        relations(load_stand(), replace(calibration, observer_noise=noise))
    sensors = (replace(calibration.sensors[0], channel="motor_speedo"),)
    with pytest.raises(
        ConfigurationError, match=r"sensors: 'motor_speedo' is no sensor of .* known"
    ):
        relations(load_stand(), replace(calibration, sensors=sensors))
