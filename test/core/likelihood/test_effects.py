"""Effects of faults by differentiation, held against those worked out on paper."""

from __future__ import annotations

import pytest
from support.models.hand_relations import slope_relations

from flea_diag.configuration import description
from flea_diag.core.likelihood.effects import Effects
from flea_diag.core.likelihood.fault_models import (
    DRIVE,
    ELECTRICAL,
    KINEMATIC,
    MECHANICAL,
    SPEED,
    Term,
)
from flea_diag.core.likelihood.plant_models import plant_models
from flea_diag.core.residuals.parameters import ActuatorParameters
from flea_diag.core.residuals.unit_difference import UNIT_TERMS
from flea_diag.errors import ModelError

K, R, KE, B, LEAD = 170.0, 3.0, 165.0, 400.0, 5e-4
P = ActuatorParameters(
    force_constant_n_per_a=K,
    winding_resistance_ohm=R,
    back_emf_v_s_per_m=KE,
    viscous_friction_n_s_per_m=B,
    coulomb_friction_n=45.0,
    load_friction_ratio=0.05,
    current_offset_a=0.3,
    encoder_m_per_rad=LEAD,
)
ENCODER = Effects(description.compiled_relations("actuator.yaml"), P)
SLOPE = Effects(slope_relations(), P)


@pytest.mark.parametrize(
    ("effects", "channel", "gains", "rates"),
    [
        (SLOPE, "motor_current", {MECHANICAL: K, ELECTRICAL: -R}, {}),
        (SLOPE, "load_force", {MECHANICAL: -1.0}, {}),
        (SLOPE, "motor_voltage", {ELECTRICAL: 1.0, DRIVE: 1.0}, {}),
        (SLOPE, "actuator_position", {KINEMATIC: 1.0}, {MECHANICAL: -B, ELECTRICAL: -KE}),
        (ENCODER, "actuator_position", {KINEMATIC: 1.0}, {SPEED: -1.0}),
        (ENCODER, "load_position", {KINEMATIC: -1.0}, {}),
    ],
)
def test_errors_of_readings(effects, channel, gains, rates):
    assert dict(effects.gains(channel)) == pytest.approx(gains)
    assert dict(effects.rates(channel)) == pytest.approx(rates)


def test_an_error_of_an_encoder_counts_at_the_nut():
    found = dict(ENCODER.gains("motor_speed", 1.0 / LEAD))
    assert found == pytest.approx({SPEED: 1.0, MECHANICAL: -B, ELECTRICAL: -KE})


def summed(terms: tuple[Term, ...]) -> dict[tuple[str, str, int], float]:
    """Gains by residual and regressor; of i - i0 as of i and of 1."""
    found: dict[tuple[str, str, int], float] = {}
    for term in terms:
        split = {term.regressor: term.gain}
        if term.regressor == "current_a":
            split = {"motor_current_a": term.gain, "one": -0.3 * term.gain}
        for name, gain in split.items():
            key = term.residual, name, term.index
            found[key] = found.get(key, 0.0) + gain
    return found


def model(fault: str, sizes: int) -> dict[tuple[str, str, int], float]:
    models = plant_models(P, slope_relations())
    return summed(next(m.terms for m in models if m.fault == fault and len(m.sizes) == sizes))


def test_a_shorted_winding_is_a_loss_of_resistance_and_of_both_constants():
    """R falls by 1 ohm, both constants by their whole; the current counts from its zero, 0.3 A."""
    assert model("winding_short", 2) == pytest.approx(
        {
            (ELECTRICAL, "motor_current_a", 0): -1.0,
            (ELECTRICAL, "one", 0): 0.3,
            (ELECTRICAL, "speed_m_s", 1): -KE,
            (MECHANICAL, "motor_current_a", 1): K,
            (MECHANICAL, "one", 1): -0.3 * K,
        }
    )


def test_a_jam_drags_with_the_direction_the_speed_and_the_load():
    assert model("jam", 3) == {
        (MECHANICAL, "direction", 0): 1.0,
        (MECHANICAL, "speed_m_s", 1): 1.0,
        (MECHANICAL, "load_and_direction_n", 2): 1.0,
    }


def test_a_motor_without_torque_has_no_back_emf_either():
    """An open one leaves the driving voltage undropped instead."""
    (torqueless,) = [
        m.terms
        for m in plant_models(P, description.compiled_relations("actuator.yaml"))
        if m.fault == "motor_failure" and any(t.residual == MECHANICAL for t in m.terms)
    ]
    assert summed(torqueless) == pytest.approx(
        {
            (ELECTRICAL, "speed_m_s", 0): -KE,
            (MECHANICAL, "motor_current_a", 0): K,
            (MECHANICAL, "one", 0): -0.3 * K,
        }
    )


def test_units_differ_as_the_relations_say():
    for residual, name, regressor, gain in UNIT_TERMS:
        if residual in SLOPE.names:
            terms = tuple(t for t in SLOPE.lost({name: -1.0}) if t.residual == residual)
            derived = {key[1]: -value for key, value in summed(terms).items()}
            claimed = summed((Term(residual, regressor, gain),))
            assert derived == pytest.approx({key[1]: value for key, value in claimed.items()})


def test_what_no_regressor_follows_is_refused():
    with pytest.raises(ModelError, match="parity_mechanical: no regressor follows d_motor_speed"):
        ENCODER.lost({"reflected_mass_kg": 1.0})
