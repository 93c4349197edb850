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

"""The driven model against fine integration, steady states and equations by hand."""

from __future__ import annotations

import importlib.util
import math
from dataclasses import replace

import numpy as np
import pytest
from support.models import hand_driven_model as hand
from support.models import linear_ema as ema
from support.models.linear_actuator import PERIOD
from support.observed import flea_parameters

from flea_diag.configuration.description import compiled_relations
from flea_diag.core import backend as backends
from flea_diag.core.observers.driven_model import DrivenModel, step_parts
from flea_diag.core.observers.observer_loops import observe_of
from flea_diag.core.observers.observer_noise import ObserverNoise
from flea_diag.core.residuals.driven_equations import driven_equations

P = flea_parameters(
    voltage_offset_v=1.5, current_offset_a=-0.3, load_friction_ratio=0.05, encoder_m_per_rad=5e-4
)
HAVE_NUMBA = importlib.util.find_spec("numba") is not None
# The first of them compiles the motion by itself, as nothing else does.
BACKENDS = ["numpy", *([pytest.param("numba", marks=pytest.mark.slow)] if HAVE_NUMBA else [])]


RELATIONS = compiled_relations("actuator.yaml")
SIGMAS = (0.26, 8.3, 1.0, 6e-5, 6e-5)


def driven(pwm: bool = False, degc: float = 25.0) -> DrivenModel:
    equations = driven_equations(RELATIONS, RELATIONS.residuals)
    return DrivenModel(equations, P, PERIOD, ObserverNoise(), SIGMAS, 1e-6, pwm, degc)


def moved(backend: str, model: DrivenModel, x: np.ndarray, u: np.ndarray) -> np.ndarray:
    """States a scan later, in numpy or as ``track_loops`` compiles it."""
    if backend == "numpy":
        return model.transition(x, u)
    new = np.empty_like(x)
    step = backends.compiled(*step_parts(model.equations))
    step(x, u, model.pwm, model.coefficients, model.record, new)
    return new


def integrated(speed: float, position: float, volts: float, load: float) -> tuple[float, float]:
    """Speed and position a scan later: Newton and Ohm by small Euler steps, nothing shared."""
    steps = 20000
    dt = PERIOD / steps
    for _ in range(steps):
        current = (volts - 1.5 - 177.0 * speed) / 2.95
        friction = (50.0 + 0.05 * abs(load)) * math.tanh(speed / 0.004) + 400.0 * speed
        position += dt * speed
        speed += dt * (177.0 * current - friction - load) / 130.0
    return speed, position


@pytest.mark.in_turn(2)
@pytest.mark.slow
@pytest.mark.parametrize("backend", BACKENDS)
@pytest.mark.parametrize(
    ("speed", "volts", "load", "tolerance"),
    [
        (0.06, 12.0, 150.0, 2e-5),
        (-0.06, -15.0, -200.0, 2e-5),
        # Friction that sets in, or turns round, within the scan: the hardest ones, and still a
        # fraction of the 8 mm/s that the process noise allows for.
        (0.0, 6.0, 50.0, 1e-3),
        (0.02, -4.0, 0.0, 1.5e-3),
    ],
)
def test_one_scan_against_fine_integration(
    backend: str, speed: float, volts: float, load: float, tolerance: float
) -> None:
    x = np.array([[0.0], [0.0], [speed], [0.04]])
    after = moved(backend, driven(), x, np.array([volts, load]))[:, 0]
    wanted, position = integrated(speed, 0.04, volts, load)
    assert after[0] == volts
    assert after[2] == pytest.approx(wanted, abs=tolerance)
    assert after[3] == pytest.approx(position, abs=tolerance * PERIOD)
    assert after[1] == pytest.approx((position - 0.04) / PERIOD, abs=tolerance)


def test_steady_speed_and_what_its_sensors_read() -> None:
    model, volts, load = driven(), 14.0, 120.0
    x = np.zeros((4, 1))
    for _ in range(200):
        x = model.transition(x, np.array([volts, load]))
    # K (V - V0 - Ke v) / R = fc + c F + B v + F, solved for v.
    speed = (177.0 * (volts - 1.5) / 2.95 - 50.0 - 6.0 - 120.0) / (177.0**2 / 2.95 + 400.0)
    assert x[2, 0] == pytest.approx(speed, rel=1e-9)
    read = dict(zip(model.channels, model.H @ x[:, 0] + model.h, strict=True))
    current = -0.3 + (volts - 1.5 - 177.0 * speed) / 2.95
    assert read["motor_current"] == pytest.approx(current, rel=1e-9)
    assert read["motor_speed"] == pytest.approx(speed / 5e-4, rel=1e-9)
    assert read["motor_voltage"] == volts
    assert read["actuator_position"] == read["load_position"] == x[3, 0]


@pytest.mark.slow
@pytest.mark.skipif(not HAVE_NUMBA, reason="numba is not installed")
@pytest.mark.parametrize("pwm", [False, True])
@pytest.mark.parametrize("u", [(9.0, 80.0), (np.nan, 80.0), (9.0, np.nan), (np.nan, np.nan)])
def test_backends_move_particles_alike(pwm: bool, u: tuple[float, float]) -> None:
    spread = np.array([[8.0], [0.1], [0.1], [0.05]])
    x = spread * np.random.default_rng(1).normal(size=(4, 300))
    one, two = (moved(name, driven(pwm), x, np.array(u)) for name in ("numpy", "numba"))
    np.testing.assert_allclose(two, one, rtol=1e-12, atol=1e-15)


@pytest.mark.parametrize("encoder", [5e-4, 0.0])
@pytest.mark.parametrize("pwm", [False, True])
@pytest.mark.parametrize("degc", [25.0, 90.0])
def test_what_is_drawn_moves_as_what_was_written_by_hand(
    encoder: float, pwm: bool, degc: float
) -> None:
    p, noise = replace(P, encoder_m_per_rad=encoder), ObserverNoise()
    known = compiled_relations("actuator.yaml", None, bool(encoder))
    equations = driven_equations(known, known.residuals)
    model = DrivenModel(equations, p, PERIOD, noise, SIGMAS, 1e-6, pwm, degc)
    rise = degc - 25.0
    for ours, wanted in zip((model.H, model.h), hand.readings(p, rise), strict=True):
        np.testing.assert_allclose(ours, wanted, rtol=1e-13, atol=1e-15)
    spread = np.array([[8.0], [0.1], [0.1], [0.05]])
    x = spread * np.random.default_rng(4).normal(size=(4, 300))
    for u in np.array([(9.0, 80.0), (-9.0, -300.0), (math.nan, 80.0), (9.0, math.nan)]):
        wanted = hand.transition(p, rise, PERIOD, x, u, pwm)
        np.testing.assert_allclose(model.transition(x, u), wanted, rtol=1e-9, atol=1e-12)
        volt = noise.voltage_walk_v if pwm or math.isnan(u[0]) else noise.voltage_v
        extra = noise.unmeasured_force_n if math.isnan(u[1]) else 0.0
        newton = math.hypot(noise.force_n, extra)
        wanted = hand.process_noise(p, rise, PERIOD, volt, newton, 1e-6)
        np.testing.assert_allclose(model.process_noise(u), wanted, rtol=1e-9, atol=1e-20)


def test_without_load_cell_forces_are_taken_to_balance() -> None:
    model = driven()
    x = np.zeros((4, 1))
    for _ in range(200):
        x = model.transition(x, np.array([14.0, 120.0]))
    after = model.transition(x, np.array([14.0, np.nan]))
    # Friction that grows with the load is the one thing that the balance cannot know.
    assert after[2, 0] == pytest.approx(x[2, 0], abs=1e-3)


def test_raw_pwm_is_no_input_and_missing_ones_are_less_certain() -> None:
    u = np.array([24.0, 0.0])
    x = np.array([[5.0], [0.0], [0.0], [0.0]])
    assert driven(pwm=True).transition(x, u)[0, 0] == 5.0
    assert driven(pwm=False).transition(x, u)[0, 0] == 24.0
    assert driven(pwm=True).driving.tolist() == [False, True, False, False, False]
    model = driven()
    known, no_volts, no_load = (
        model.process_noise(np.array(given)) for given in ((1.0, 1.0), (np.nan, 1.0), (1.0, np.nan))
    )
    assert no_volts[2, 2] > known[2, 2]
    assert no_load[2, 2] > known[2, 2]
    assert model.process_noise(np.array([2.0, 3.0])) is known


def test_warm_winding_carries_less_current() -> None:
    warm = driven().warmed(75.0)
    # Copper: 0.393 % per kelvin.
    assert 1.0 / warm.H[0, 0] == pytest.approx(2.95 * 1.1965)
    assert warm.voltage_v(1.7) == pytest.approx(1.5 + 2.95 * 1.1965 * 2.0)


@pytest.mark.skipif(not HAVE_NUMBA, reason="numba is not installed")
def test_a_description_is_compiled_once_whatever_channels_are_there() -> None:
    """What the loops call is its friction and its heat; they take a quarter of a minute."""
    several = (compiled_relations("actuator.yaml", channels) for channels in (None, ema.STAND))
    one, other = (observe_of(driven_equations(r, r.residuals)) for r in several)
    assert one.py_func.__qualname__ == other.py_func.__qualname__
