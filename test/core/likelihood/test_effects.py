"""Effects of faults by differentiation, held against those worked out on paper."""

from __future__ import annotations

import pytest
from support.models.hand_relations import slope_relations

from flea_diag import configuration
from flea_diag.core.likelihood.effects import Effects
from flea_diag.core.likelihood.fault_models import (
    DRIVE,
    ELECTRICAL,
    KINEMATIC,
    MECHANICAL,
    SPEED,
    Term,
    plant_models,
)
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
ENCODER = Effects(configuration.compiled_relations("actuator.yaml"), P)
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


def test_a_shorted_winding_is_a_loss_of_resistance_and_of_both_constants():
    (short,) = [model for model in plant_models(P) if model.fault == "winding_short"]
    constants = {"force_constant_n_per_a": K, "back_emf_v_s_per_m": KE}
    derived = SLOPE.lost({"winding_resistance_ohm": 1.0}, 0) + SLOPE.lost(constants, 1)
    assert summed(short.terms) == pytest.approx(summed(derived))


def test_drags_are_gains_of_friction():
    """A jam adds what a loss of friction leaves, with the other sign."""
    jam = next(m for m in plant_models(P) if m.fault == "jam" and len(m.sizes) == 3)
    names = ("coulomb_friction_n", "viscous_friction_n_s_per_m", "load_friction_ratio")
    derived = tuple(t for k, name in enumerate(names) for t in SLOPE.lost({name: -1.0}, k))
    assert summed(jam.terms) == pytest.approx(summed(derived))


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
