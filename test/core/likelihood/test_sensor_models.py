"""Models of sensor faults held against the relations themselves, formed on faulty readings."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from support.models.hand_relations import BY_HAND, slope_relations

from flea_diag.configuration.description import compiled_relations
from flea_diag.core.likelihood.fault_models import REGRESSORS, FaultModel
from flea_diag.core.likelihood.regressors import regressors
from flea_diag.core.likelihood.sensor_models import sensor_models
from flea_diag.core.residuals.parameters import ActuatorParameters
from flea_diag.core.residuals.residual import Signals, direction
from flea_diag.core.residuals.residual_rows import TEMPERATURES

# Offsets that are far from zero: a scale factor acts on the reading, not on what exceeds its zero.
P = ActuatorParameters(current_offset_a=-0.26, voltage_offset_v=1.8, load_friction_ratio=0.0)
N = 200
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
    zero = np.zeros(N)
    return Signals(
        current_a=random.normal(0.5, 1.0, N),
        voltage_v=random.normal(2.0, 8.0, N),
        commanded_voltage_v=zero,
        speed_m_s=speed,
        acceleration_m_s2=np.gradient(speed, 0.01),
        load_n=random.normal(40.0, 150.0, N),
        position_m=zero,
        load_position_m=zero,
        encoder_speed_rad_s=zero,
        position_rate_m_s=speed,
        motor_temperature_degc=zero + 30.0,
        nut_temperature_degc=zero + 30.0,
        direction=direction(P, speed),
    )


def effect(model: FaultModel, sizes: tuple[float, ...], residual: str, read: Signals) -> np.ndarray:
    values = dict(
        zip(REGRESSORS, regressors(P, read, dict.fromkeys(TEMPERATURES, 30.0)), strict=True)
    )
    terms = [term for term in model.terms if term.residual == residual]
    return sum((sizes[t.index] * t.gain * values[t.regressor] for t in terms), np.zeros(N))


@pytest.mark.parametrize("residual", ["parity_mechanical", "parity_electrical"])
@pytest.mark.parametrize(("fault", "change", "sizes"), CASES)
def test_a_model_adds_what_the_faulty_reading_adds(fault, change, sizes, residual):
    true = signals()
    field = READINGS[fault.rsplit("_", 1)[0]]
    read = true._replace(**{field: change(getattr(true, field))})
    relation = BY_HAND[residual]
    (model,) = [m for m in sensor_models(P, slope_relations(), commanded=False) if m.fault == fault]
    added = relation(P, read) - relation(P, true)
    np.testing.assert_allclose(effect(model, sizes, residual, read), added, atol=1e-9)


def added(channel: str, factor: float) -> tuple[str, np.ndarray, Signals]:
    """A residual, what a scaled reading of the channel adds to it, and all signals then."""
    true = signals()
    if channel in TEMPERATURES:  # what it should read is 30 degC in `effect`
        return channel, np.full(N, 30.0 * factor - 30.0), true
    field = READINGS[channel]
    read = true._replace(**{field: factor * getattr(true, field)})
    relation = BY_HAND["parity_mechanical"]
    return "parity_mechanical", relation(P, read) - relation(P, true), read


@pytest.mark.parametrize("factor", [0.6, 1.4, 1.6])
@pytest.mark.parametrize("channel", [*READINGS, *TEMPERATURES])
def test_any_scaling_from_0_6_to_1_6_lies_within_the_bounds_of_its_model(channel, factor):
    residual, error, read = added(channel, factor)
    (model,) = [m for m in sensor_models(P, slope_relations()) if m.fault == f"{channel}_scaling"]
    of_one = effect(model, (1.0,), residual, read)
    size = float(of_one @ error / (of_one @ of_one))
    np.testing.assert_allclose(size * of_one, error, atol=1e-9)
    assert model.sizes[0].low - 1e-9 <= size <= model.sizes[0].high + 1e-9


@pytest.mark.parametrize("encoder", [0.0, 5e-4])
def test_every_term_is_made_of_a_regressor(encoder):
    p = replace(P, encoder_m_per_rad=encoder)
    known = compiled_relations("actuator.yaml", has_encoder=bool(encoder))
    models = sensor_models(p, known)
    assert {term.regressor for model in models for term in model.terms} <= set(REGRESSORS)
    channels = {model.fault.rsplit("_", 1)[0] for model in models}
    assert ("motor_speed" in channels) is bool(encoder)
