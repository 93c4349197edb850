from __future__ import annotations

from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from flea_diag.core.residuals import residual as relations
from flea_diag.core.residuals.parameters import ActuatorParameters
from flea_diag.core.residuals.residual import (
    PARITIES,
    PARITY_NAMED,
    UNIT_PARAMETERS,
    Signals,
    direction,
)

P = ActuatorParameters(
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


def test_worked_values():
    # 150 N of motor force + 40 of the load helping - (10 + 0.1 * 40) - 200 * 0.05 - 50 * 0.4
    assert relations.mechanical_n(P, MOVING) == pytest.approx(150 + 40 - 14 - 10 - 20)
    # 16 - 1 - 2 * 1.5 - 200 * 0.05
    assert relations.electrical_v(P, MOVING) == pytest.approx(2.0)
    assert relations.drive_v(P, MOVING) == pytest.approx(16.0 - 0.2 - 13.5)
    assert relations.kinematic_m(P, MOVING) == pytest.approx(0.003)
    assert relations.speed_m_s(P, MOVING) == pytest.approx(0.055 - 0.05)


def test_friction_opposes_the_motion_and_vanishes_at_rest():
    assert relations.friction_n(P, MOVING) == pytest.approx(24.0)
    back = MOVING._replace(speed_m_s=-0.05, direction=-MOVING.direction)
    assert relations.friction_n(P, back) == pytest.approx(-24.0)
    assert relations.friction_n(P, MOVING._replace(speed_m_s=0.0, direction=0.0)) == 0.0


def test_a_hot_winding_drops_more_voltage():
    hot = MOVING._replace(winding_rise_k=100.0)
    # Copper: 39.3 % more over 100 K, of a 3 V drop.
    assert relations.electrical_v(P, hot) == pytest.approx(2.0 - 3.0 * 0.393)


@given(
    st.sampled_from(PARITIES),
    st.floats(-3, 3),
    st.floats(-0.1, 0.1),
    st.floats(-3, 3),
    st.floats(-500, 500),
)
def test_sensitivities_are_the_differences_of_the_relations(parity, amps, speed, rate, load):
    s = signals(current_a=amps, speed_m_s=speed, acceleration_m_s2=rate, load_n=load)
    none = (0.0,) * len(UNIT_PARAMETERS)
    claimed = none if parity.sensitivity is None else parity.sensitivity(P, s)
    for name, found in zip(UNIT_PARAMETERS, claimed, strict=True):
        step = 1e-3
        up = replace(P, **{name: getattr(P, name) + step})
        down = replace(P, **{name: getattr(P, name) - step})
        measured = (parity.relation(up, s) - parity.relation(down, s)) / (2 * step)
        assert found == pytest.approx(measured, rel=1e-6, abs=1e-6), name


@pytest.mark.parametrize(
    ("name", "signal"),
    [
        ("parity_mechanical", "current_a"),
        ("parity_mechanical", "load_n"),
        ("parity_electrical", "voltage_v"),
        ("parity_drive", "commanded_voltage_v"),
        ("parity_kinematic", "load_position_m"),
        ("parity_speed", "encoder_speed_rad_s"),
    ],
)
def test_without_a_signal_there_is_no_residual(name, signal):
    lacking = MOVING._replace(**{signal: float("nan")})
    assert PARITY_NAMED[name].relation(P, MOVING) == PARITY_NAMED[name].relation(P, MOVING)
    assert str(PARITY_NAMED[name].relation(P, lacking)) == "nan"
