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

"""Derived equations against the ones written by hand, and their steps against fine integration."""

from __future__ import annotations

import math
from fractions import Fraction

import numpy as np
import pytest
from support.models import ema_oracle as oracle
from support.places import WING

from flea_diag.configuration.files import load_yaml
from flea_diag.core.bond_graph.actuator import Actuator, actuator
from flea_diag.core.bond_graph.discretisation import phi_functions
from flea_diag.core.bond_graph.state_space import StateSpace
from flea_diag.core.causal_graph.operating_point import QUADRANTS, operating_values
from flea_diag.errors import ModelError

PERIOD = 0.01
P = {name: float(text) for name, text in oracle.PARAMETERS.items()}


@pytest.fixture(scope="module")
def flea() -> Actuator:
    """With the friction of the equations by hand, which turns round within 3 rad/s."""
    return actuator(load_yaml("actuator.yaml")).with_parameters({"friction_smooth_speed": 3.0})


@pytest.fixture(scope="module")
def stand(flea: Actuator) -> StateSpace:
    return flea.state_space("stand", oracle.CHANNELS)


def by_hand(x: np.ndarray, u: dict[str, float]) -> np.ndarray:
    """Rates by the hand-written equations, shape (n,)."""
    state = dict(zip(oracle.STATES, x, strict=True))
    slopes = oracle.rates(state, u, P, oracle.smooth_friction(state["omega"], P))
    return np.array([slopes[name] for name in oracle.STATES])


def inputs(model: StateSpace, **given: float) -> np.ndarray:
    return np.array([given[name] for name in model.inputs])


def test_rates_and_readings_are_those_of_the_equations_by_hand(stand: StateSpace) -> None:
    assert set(stand.states) == set(oracle.STATES)
    order = [stand.states.index(name) for name in oracle.STATES]
    rng = np.random.default_rng(1)
    spread = np.array([2, 80, 1e-5, 0.05, 9, 9, 9, 0.1, 0.1])
    x = rng.normal(size=(40, 9)) * spread + [0, 0, 0, 0, 30, 30, 30, 0, 0]
    given = {"commanded_voltage": 9.0, "commanded_load": 120.0, "ambient_temperature": 24.0}
    ours = np.empty_like(x)
    ours[:, order] = x
    found = stand.derivatives(ours, inputs(stand, **given))
    wanted = np.array([by_hand(row, given) for row in x])
    np.testing.assert_allclose(found[:, order], wanted, rtol=1e-9, atol=1e-9)
    seen = stand.measure(ours, inputs(stand, **given))
    for k, row in enumerate(x):
        reading = oracle.readings(dict(zip(oracle.STATES, row, strict=True)), P)
        np.testing.assert_allclose(seen[k], [reading[c] for c in oracle.CHANNELS], rtol=1e-12)


def test_printed_equations_are_the_published_ones(flea: Actuator) -> None:
    """With the offset of the reading, the warm winding and friction that grows with the load."""
    lines = flea.state_space("driven").equations(flea.graph.tokens()).splitlines()
    warm = "R*(1 + alpha*(T_w - T_0))"
    assert lines[0] == f"d i/dt = (motor_voltage - V_0 - {warm}*i - Km*omega)/L"
    dry = "(tau_c + mu*fabs(load_force))*tanh(omega/w_s)"
    assert lines[1] == f"d omega/dt = (Kt*i - {dry} - B*omega - rho*load_force)/J"


def test_measured_load_cuts_the_load_side_off(flea: Actuator) -> None:
    driven = flea.state_space("driven")
    assert set(driven.inputs) == {"motor_voltage", "load_force", "ambient_temperature"}
    assert "v_load" not in driven.states
    assert "load_position" in driven.outputs


def test_particles_with_parameters_of_their_own(flea: Actuator) -> None:
    model = flea.state_space("driven")
    rng = np.random.default_rng(2)
    x = rng.normal(size=(5, len(model.states)))
    u = rng.normal(size=len(model.inputs))
    p = model.nominal_values * rng.uniform(0.9, 1.1, size=(5, len(model.parameters)))
    together = model.derivatives(x, u, p)
    alone = [model.derivatives(x[k], u, p[k]) for k in range(5)]
    np.testing.assert_array_equal(together, alone)
    # One state, many parameter rows.
    assert model.derivatives(x[0], u, p).shape == (5, len(model.states))


def test_jacobians_are_those_of_differences(stand: StateSpace, flea: Actuator) -> None:
    values = operating_values(flea, QUADRANTS[0])
    x = np.array([values[name] for name in stand.states])
    u = np.array([values[name] for name in stand.inputs])
    linear = stand.linearise(x, u)
    for k in range(len(x)):
        h = 1e-6 * max(1.0, abs(x[k]))
        up, down = x.copy(), x.copy()
        up[k], down[k] = x[k] + h, x[k] - h
        slope = (stand.derivatives(up, u) - stand.derivatives(down, u)) / (2 * h)
        np.testing.assert_allclose(linear.a[:, k], slope, rtol=1e-5, atol=1e-4)


def test_output_that_nothing_gives_is_named(flea: Actuator) -> None:
    with pytest.raises(ModelError, match="no element gives 'torque'"):
        flea.state_space("stand", ["torque"])


@pytest.mark.parametrize("z", [-60.0, -2.5, -0.5, -0.499, -1e-3, -1e-12, 0.0, 0.3, 4.0])
def test_phi_functions_are_their_series(z: float) -> None:
    """In exact fractions, also where the quotients that define them cancel."""
    terms = [Fraction(z) ** k / math.factorial(k + 1) for k in range(250)]
    further = [Fraction(z) ** k / math.factorial(k + 2) for k in range(250)]
    exact = float(sum(terms)), float(sum(further))
    assert phi_functions(z) == pytest.approx(exact, rel=1e-15)


def test_second_actuator_goes_through_the_same_code() -> None:
    wing = actuator(load_yaml(WING))
    model = wing.state_space("driven")
    values = operating_values(wing, QUADRANTS[0])
    x = np.array([values[n] for n in model.states])
    u = np.array([values[n] for n in model.inputs])
    rates = dict(zip(model.states, model.derivatives(x, u), strict=True))
    assert rates["i"] == pytest.approx(0.0, abs=1e-6)
    assert rates["x_nut"] == pytest.approx(8.0e-4 * 0.25 * 120.0)
