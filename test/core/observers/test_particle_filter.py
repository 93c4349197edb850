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

"""Particle filters against the exact answer of the Kalman filter, hidden states included."""

from __future__ import annotations

import importlib.util
from dataclasses import replace

import numpy as np
import pytest
from support.models.linear_actuator import START, model, sharpened, simulated
from support.models.linear_model import LinearModel

from flea_diag.core import backend as backends
from flea_diag.core.observers.kalman import KalmanFilter
from flea_diag.core.observers.particle_filter import ParticleFilter
from flea_diag.core.observers.state_filter import Filter, Innovation
from flea_diag.errors import ConfigurationError

HIDDEN = 1
"""The speed: nothing measures it."""
STEPS = 1000

needs_numba = pytest.mark.skipif(
    importlib.util.find_spec("numba") is None, reason="numba is not installed"
)
# The first of them compiles the step by itself, as nothing else does.
compiled = pytest.param("numba", marks=[needs_numba, pytest.mark.slow])
backend = pytest.mark.parametrize("backend", ["numpy", compiled])


def particle_filter(
    given: LinearModel,
    particles: int = 200,
    proposal: str = "optimal",
    backend: str = "numpy",
    seed: int = 0,
    start: np.ndarray = START,
) -> ParticleFilter:
    return ParticleFilter(
        given,
        np.zeros(3),
        start,
        np.random.default_rng(seed),
        particles=particles,
        proposal=proposal,
        backend=backend,
    )


def run(filtered: Filter, U: np.ndarray, Y: np.ndarray) -> tuple[np.ndarray, list[Innovation]]:
    means, told = [], []
    for u, y in zip(U, Y, strict=True):
        filtered.predict(u)
        told.append(filtered.update(y))
        means.append(filtered.mean)
    return np.array(means), told


def rmse(estimate: np.ndarray, truth: np.ndarray) -> np.ndarray:
    return np.sqrt(np.mean((estimate - truth) ** 2, axis=0))


@pytest.mark.slow
@backend
@pytest.mark.parametrize("factor", [0.0, 5.0])
def test_within_two_percent_of_kalman_in_every_state(backend: str, factor: float) -> None:
    """With the sensors as they are, and five times better than the process noise."""
    given = sharpened(model(), factor) if factor else model()
    ratios = []
    for seed in (1, 2, 3):
        X, U, Y = simulated(given, STEPS, seed)
        exact, _ = run(KalmanFilter(given, np.zeros(3), START), U, Y)
        ours, _ = run(particle_filter(given, 200, backend=backend, seed=seed), U, Y)
        ratios.append(rmse(ours, X) / rmse(exact, X))
    mean = np.mean(ratios, axis=0)
    assert (mean < 1.02).all(), mean
    assert mean[HIDDEN] < 1.02


@pytest.mark.parametrize(("factor", "worse"), [(5.0, 1.4), (50.0, 10.0)])
def test_bootstrap_collapses_on_sensors_better_than_the_process_noise(
    factor: float, worse: float
) -> None:
    given = sharpened(model(), factor)
    X, U, Y = simulated(given, STEPS, 1)
    exact, _ = run(KalmanFilter(given, np.zeros(3), START), U, Y)
    literal, blind = run(particle_filter(given, 100, "bootstrap"), U, Y)
    ours, told = run(particle_filter(given, 100), U, Y)
    assert np.median([t.ess for t in blind]) < 5.0
    assert np.median([t.ess for t in told]) > 30.0
    assert (rmse(literal, X) / rmse(exact, X))[[0, 2]].min() > worse
    assert (rmse(ours, X) / rmse(exact, X)).max() < 1.03


def test_bootstrap_agrees_with_kalman_on_poor_sensors() -> None:
    given = sharpened(model(), 0.5)
    X, U, Y = simulated(given, STEPS, 1)
    exact, _ = run(KalmanFilter(given, np.zeros(3), START), U, Y)
    literal, _ = run(particle_filter(given, 2000, "bootstrap"), U, Y)
    assert (rmse(literal, X) / rmse(exact, X)).max() < 1.03


@backend
def test_first_scan_from_a_known_state_is_exact(backend: str) -> None:
    """All particles alike: the optimal proposal's mean has no Monte Carlo error left."""
    given = sharpened(model(), 5.0)
    _, U, Y = simulated(given, 1, 6)
    nothing = np.zeros((3, 3))
    kalman = KalmanFilter(given, np.zeros(3), nothing)
    ours = particle_filter(given, 50, backend=backend, start=nothing)
    for filtered in (kalman, ours):
        filtered.predict(U[0])
    exact, told = kalman.update(Y[0]), ours.update(Y[0])
    np.testing.assert_allclose(ours.mean, kalman.mean, rtol=1e-9)
    np.testing.assert_allclose(told.residual, exact.residual, rtol=1e-9)
    np.testing.assert_allclose(told.sigma, exact.sigma, rtol=1e-9)
    assert told.nis == pytest.approx(exact.nis)
    assert told.ess == pytest.approx(50.0)


@backend
def test_prediction_and_its_sigma_are_kalmans(backend: str) -> None:
    given = model()
    _, U, Y = simulated(given, 400, 5)
    Y[100:150, 0] = np.nan
    Y[200:230, 1] = np.nan
    Y[300:310] = np.nan
    _, exact = run(KalmanFilter(given, np.zeros(3), START), U, Y)
    _, ours = run(particle_filter(given, 4000, backend=backend), U, Y)
    for told, wanted in zip(ours[20:], exact[20:], strict=True):
        assert told.measured == wanted.measured
        sigma = np.where(wanted.sigma > 0, wanted.sigma, 1.0)
        np.testing.assert_array_equal(np.isnan(told.residual), np.isnan(wanted.residual))
        np.testing.assert_allclose(told.sigma / sigma, wanted.sigma / sigma, atol=0.08)
    apart = [
        (told.prediction - wanted.prediction)[wanted.sigma > 0] / wanted.sigma[wanted.sigma > 0]
        for told, wanted in zip(ours, exact, strict=True)
    ]
    assert np.sqrt(np.mean(np.concatenate(apart) ** 2)) < 0.05
    nis = [(told.nis, wanted.nis) for told, wanted in zip(ours, exact, strict=True)]
    assert np.corrcoef(np.array(nis).T)[0, 1] > 0.98


@needs_numba
@pytest.mark.slow
@pytest.mark.parametrize("proposal", ["optimal", "bootstrap"])
def test_backends_share_random_numbers_and_give_the_same_answers(proposal: str) -> None:
    given = sharpened(model(), 2.0)
    _, U, Y = simulated(given, 600, 9)
    Y[50:60, 0] = np.nan
    Y[70] = np.nan
    Y[80, 1] = np.inf
    one, told = run(particle_filter(given, 100, proposal, "numpy", 7), U, Y)
    two, also = run(particle_filter(given, 100, proposal, "numba", 7), U, Y)
    np.testing.assert_allclose(two, one, rtol=1e-7, atol=1e-10)
    np.testing.assert_allclose([t.ess for t in also], [t.ess for t in told], rtol=1e-6)
    np.testing.assert_allclose([t.nis for t in also], [t.nis for t in told], rtol=1e-5)
    np.testing.assert_allclose(
        [t.sigma for t in also], [t.sigma for t in told], rtol=1e-6, atol=1e-12
    )


@backend
def test_same_seed_same_bits_other_seed_other_cloud(backend: str) -> None:
    given = model()
    _, U, Y = simulated(given, 50, 9)
    once, _ = run(particle_filter(given, backend=backend, seed=3), U, Y)
    twice, _ = run(particle_filter(given, backend=backend, seed=3), U, Y)
    other, _ = run(particle_filter(given, backend=backend, seed=4), U, Y)
    np.testing.assert_array_equal(once, twice)
    assert (once != other).all()


@backend
def test_frozen_is_blind_to_what_is_measured(backend: str) -> None:
    given = model()
    _, U, Y = simulated(given, 60, 2)
    clouds = []
    for shift in (0.0, 5.0):
        ours = particle_filter(given, backend=backend)
        for k, (u, y) in enumerate(zip(U, Y, strict=True)):
            ours.predict(u)
            told = ours.update(y + (shift if k >= 40 else 0.0), frozen=k >= 40)
        clouds.append((ours.cloud[0], told.residual))
        np.testing.assert_array_equal(told.mean, ours.mean)
    np.testing.assert_array_equal(clouds[0][0], clouds[1][0])
    np.testing.assert_allclose(clouds[1][1] - clouds[0][1], 5.0)


@backend
def test_scans_without_readings_spread_as_the_process_noise_does(backend: str) -> None:
    given = model()
    start = np.zeros((3, 3))
    ours = particle_filter(given, 20000, backend=backend, start=start)
    kalman = KalmanFilter(given, np.zeros(3), start)
    for k in range(8):
        for filtered in (ours, kalman):
            filtered.predict(np.zeros(3))
            if k % 2:  # with and without an update in between
                filtered.update(np.full(2, np.nan))
    scale = np.sqrt(np.diag(kalman.covariance))
    np.testing.assert_allclose(
        ours.covariance / np.outer(scale, scale),
        kalman.covariance / np.outer(scale, scale),
        atol=0.03,
    )


@backend
@pytest.mark.parametrize("value", [1e300, -1e200, np.inf, np.nan])
def test_no_reading_can_poison_the_cloud(backend: str, value: float) -> None:
    given = model()
    X, U, Y = simulated(given, 400, 12)
    Y[200, 1] = value
    ours = particle_filter(given, backend=backend)
    means, told = run(ours, U, Y)
    assert np.isfinite(means).all()
    assert rmse(means[300:], X[300:])[2] < 1.2e-4
    assert not told[-1].diverged


@backend
def test_lost_track_is_said(backend: str) -> None:
    given = sharpened(model(), 5.0)
    _, U, Y = simulated(given, 600, 3)
    wrong = replace(given, A=given.A * 0.7)
    _, healthy = run(particle_filter(given, backend=backend), U, Y)
    _, lost = run(particle_filter(wrong, backend=backend), U, Y)
    assert not any(told.diverged for told in healthy)
    assert lost[-1].diverged
    assert np.mean([told.nis for told in healthy[50:]]) == pytest.approx(2.0, abs=0.3)


@backend
def test_adopted_offsets_move_the_prediction(backend: str) -> None:
    given = model()
    _, U, Y = simulated(given, 100, 3)
    ours = particle_filter(given, backend=backend)
    run(ours, U[:50], Y[:50])
    ours.adopt(replace(given, h=given.h + np.array([0.5, 0.0])))
    ours.predict(U[50])
    shifted = ours.update(Y[50])
    plain = particle_filter(given, backend=backend)
    run(plain, U[:50], Y[:50])
    plain.predict(U[50])
    np.testing.assert_allclose(
        shifted.prediction - plain.update(Y[50]).prediction, [0.5, 0.0], atol=1e-12
    )


@pytest.mark.parametrize(
    ("wrong", "said"),
    [
        ({"particles": 1}, "particles = 1"),
        ({"proposal": "prior"}, "proposal 'prior'"),
        ({"threshold": 1.5}, "threshold = 1.5"),
        ({"backend": "jax"}, "backend 'jax'"),
    ],
)
def test_parameters_out_of_limits_are_named(wrong: dict[str, object], said: str) -> None:
    with pytest.raises(ConfigurationError, match=said):
        ParticleFilter(model(), np.zeros(3), START, np.random.default_rng(0), **wrong)


def test_numba_that_is_not_there_is_said(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(backends, "find_spec", lambda name: None)
    assert backends.chosen("auto") == "numpy"
    with pytest.raises(ConfigurationError, match="pip install"):
        backends.chosen("numba")
