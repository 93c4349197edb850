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

"""Models of sensor faults held against the relations themselves, formed on faulty readings."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from support.models.hand_relations import (
    BY_HAND,
    Signals,
    catalogue_effects,
    channels_of,
    direction,
    slope_relations,
)
from support.observed import flea_parameters

from flea_diag.configuration.description import compiled_relations, described
from flea_diag.configuration.files import load_yaml
from flea_diag.core.faults.fault import catalogue
from flea_diag.core.likelihood.effect_set import EffectSet, effect_set
from flea_diag.core.likelihood.fault_models import FaultModel
from flea_diag.core.residuals.parameters import ActuatorParameters
from flea_diag.core.symbolic.expression import FUNCTIONS

FLEA = compiled_relations("actuator.yaml").residuals

# Offsets that are far from zero: a scale factor acts on the reading, not on what exceeds its zero.
P = flea_parameters(current_offset_a=-0.26, voltage_offset_v=1.8, load_friction_ratio=0.0)
WITH_ENCODER = replace(P, encoder_m_per_rad=5e-4)
N = 200
SLOPE = catalogue_effects(slope_relations())
ENCODER = catalogue_effects(compiled_relations("actuator.yaml"))
READINGS = {"motor_current": "current_a", "load_force": "load_n"}
CASES = [
    ("motor_current_scaling", lambda y: 1.3 * y, (1.0 - 1.0 / 1.3,)),
    ("motor_current_scaling", lambda y: 0.7 * y, (1.0 - 1.0 / 0.7,)),
    ("motor_current_bias", lambda y: y + 0.4, (0.4,)),
    ("load_force_scaling", lambda y: 0.8 * y, (1.0 - 1.0 / 0.8,)),
    ("load_force_bias", lambda y: y - 30.0, (-30.0,)),
]


def signals() -> Signals:
    random = np.random.default_rng(7)
    speed = 0.05 * np.sin(np.linspace(0.0, 20.0, N))
    position = 0.05 - 0.05 * np.cos(np.linspace(0.0, 20.0, N))
    return Signals(
        current_a=random.normal(0.5, 1.0, N),
        voltage_v=random.normal(2.0, 8.0, N),
        commanded_voltage_v=random.normal(2.0, 8.0, N),
        speed_m_s=speed,
        acceleration_m_s2=np.gradient(speed, 0.01),
        load_n=random.normal(40.0, 150.0, N),
        position_m=position,
        load_position_m=position,
        encoder_speed_rad_s=speed / 5e-4,
        position_rate_m_s=speed,
        direction=direction(P, speed),
    )


def basis(effects: EffectSet, p: ActuatorParameters, read: Signals) -> dict[str, np.ndarray]:
    """Basis signals by name, as the observer computes them."""
    known = {**channels_of(p, read), **{f"{name}_degc": 30.0 for name in tuple(FLEA.predictions)}}
    x = [known.get(name, np.nan) for name in effects.signals]
    made = effects.functions["shapes"](p, x)
    for (name, shape), argument in zip(effects.shapes.items(), made, strict=True):
        x[effects.signals.index(name)] = FUNCTIONS[shape.name](argument)
    columns = effects.functions["columns"](p, x)
    return {name: column + np.zeros(N) for name, column in zip(effects.names, columns, strict=True)}


def effect(
    model: FaultModel,
    sizes: tuple[float, ...],
    residual: str,
    read: Signals,
    effects: EffectSet = SLOPE,
    p: ActuatorParameters = P,
) -> np.ndarray:
    values = basis(effects, p, read)
    terms = [term for term in model.terms if term.residual == residual]
    return sum((sizes[t.index] * t.gain * values[t.regressor] for t in terms), np.zeros(N))


@pytest.mark.parametrize("residual", ["parity_mechanical", "parity_electrical"])
@pytest.mark.parametrize(("fault", "change", "sizes"), CASES)
def test_a_model_adds_what_the_faulty_reading_adds(fault, change, sizes, residual):
    true = signals()
    field = READINGS[fault.rsplit("_", 1)[0]]
    read = true._replace(**{field: change(getattr(true, field))})
    relation = BY_HAND[residual]
    (model,) = [m for m in SLOPE.bound(P) if m.fault == fault]
    added = relation(P, read) - relation(P, true)
    np.testing.assert_allclose(effect(model, sizes, residual, read), added, atol=1e-9)


def added(channel: str, factor: float) -> tuple[str, np.ndarray, Signals]:
    """A residual, what a scaled reading of the channel adds to it, and all signals then."""
    true = signals()
    if channel in tuple(FLEA.predictions):  # what it should read is 30 degC in `basis`
        return channel, np.full(N, 30.0 * factor - 30.0), true
    field = READINGS[channel]
    read = true._replace(**{field: factor * getattr(true, field)})
    relation = BY_HAND["parity_mechanical"]
    return "parity_mechanical", relation(P, read) - relation(P, true), read


@pytest.mark.parametrize("factor", [0.6, 1.4, 1.6])
@pytest.mark.parametrize("channel", [*READINGS, *tuple(FLEA.predictions)])
def test_any_scaling_from_0_6_to_1_6_lies_within_the_bounds_of_its_model(channel, factor):
    residual, error, read = added(channel, factor)
    (model,) = [m for m in SLOPE.bound(P) if m.fault == f"{channel}_scaling"]
    of_one = effect(model, (1.0,), residual, read)
    size = float(of_one @ error / (of_one @ of_one))
    np.testing.assert_allclose(size * of_one, error, atol=1e-9)
    assert model.sizes[0].low - 1e-9 <= size <= model.sizes[0].high + 1e-9


def consistent() -> Signals:
    """Signals that every relation of the FLEA holds for exactly."""
    p, true = WITH_ENCODER, signals()
    drag = p.coulomb_friction_n * true.direction + p.viscous_friction_n_s_per_m * true.speed_m_s
    force = true.load_n + drag + p.reflected_mass_kg * true.acceleration_m_s2
    current = force / p.force_constant_n_per_a
    volts = p.winding_resistance_ohm * current + p.back_emf_v_s_per_m * true.speed_m_s
    volts = volts + p.voltage_offset_v
    return true._replace(
        current_a=current + p.current_offset_a, voltage_v=volts, commanded_voltage_v=volts
    )


DEAD = {
    "motor_current": {"current_a": 0.1},
    "motor_voltage": {"voltage_v": -2.0},
    # A dead encoder has no direction either; the position's slope is what is left.
    "motor_speed": {"encoder_speed_rad_s": 0.0, "speed_m_s": 0.0, "direction": 0.0},
    "actuator_position": {"position_m": 0.02, "position_rate_m_s": 0.0},
    "load_position": {"load_position_m": 0.02},
}
LEVEL = {
    "motor_current": 0.1 - P.current_offset_a,
    "motor_voltage": -2.0 - P.voltage_offset_v,
    "motor_speed": 0.0,
    "actuator_position": 0.02,
    "load_position": 0.02,
}


@pytest.mark.parametrize("channel", DEAD)
def test_a_dead_reading_adds_what_its_model_says_in_every_relation(channel):
    """All of the truth lost, and a reading that stands still somewhere."""
    p, true = WITH_ENCODER, consistent()
    read = true._replace(**{name: value + np.zeros(N) for name, value in DEAD[channel].items()})
    (model,) = [m for m in ENCODER.bound(p) if m.fault == f"{channel}_dead"]
    for residual, relation in BY_HAND.items():
        assert np.abs(relation(p, true)).max() < 1e-9, "the signals are no healthy ones"
        found = effect(model, (1.0, LEVEL[channel]), residual, read, ENCODER, p)
        np.testing.assert_allclose(found, relation(p, read), atol=1e-6, err_msg=residual)


def test_a_dead_load_cell_lacks_the_force_of_the_motor_and_no_drag():
    """Else it would explain any drag under a steady load: friction and inertia are left out."""
    p, true = WITH_ENCODER, consistent()
    (model,) = [m for m in ENCODER.bound(p) if m.fault == "load_force_dead"]
    found = effect(model, (1.0, 12.0), "parity_mechanical", true, ENCODER, p)
    force = p.force_constant_n_per_a * (true.current_a - p.current_offset_a)
    np.testing.assert_allclose(found, force - 12.0, atol=1e-9)


@pytest.mark.parametrize(("effects", "encoder"), [(SLOPE, 0.0), (ENCODER, 5e-4)])
def test_every_term_is_made_of_a_basis_signal(effects, encoder):
    models = effects.bound(replace(P, encoder_m_per_rad=encoder))
    assert {term.regressor for model in models for term in model.terms} <= set(effects.names)
    assert len(set(effects.names)) == len(effects.names)
    channels = {m.fault.rsplit("_", 1)[0] for m in models if m.terms}
    assert ("motor_speed" in channels) is bool(encoder)


def test_a_drift_has_grown_for_one_of_the_ages_that_the_catalogue_names():
    content = load_yaml("faults.yaml")
    content["sensor_errors"]["motor_current"]["ages_s"] = [0.5, 6.0]
    rows = catalogue(content, described("actuator.yaml"))
    found = effect_set(SLOPE.relations, rows.values()).bound(P)
    mechanical = {}
    for model in (m for m in found if m.fault == "motor_current_drift"):
        gains = {t.regressor: t.gain for t in model.terms if t.residual == "parity_mechanical"}
        mechanical[gains["one"] / gains["elapsed_s"]] = gains["elapsed_s"]
    assert sorted(mechanical) == pytest.approx([0.5, 6.0])
    assert set(mechanical.values()) == {P.force_constant_n_per_a}
