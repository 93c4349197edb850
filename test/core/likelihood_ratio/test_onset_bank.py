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

"""The recursion over windows against dense densities, and what it finds in drawn residuals."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import multivariate_normal

from flea_diag.core.likelihood.basis import Basis
from flea_diag.core.likelihood.fault_models import FaultModel, Size, Term
from flea_diag.core.likelihood_ratio.fault_signatures import FaultSignatures
from flea_diag.core.likelihood_ratio.onset_bank import OnsetBank
from flea_diag.core.likelihood_ratio.onset_evidence import WindowHistory
from flea_diag.core.likelihood_ratio.ratio_test import RatioTest
from flea_diag.core.likelihood_ratio.residual_window import ResidualWindow
from flea_diag.core.run_law.level_noise import LevelNoise, level_noise
from flea_diag.core.run_law.run_windows import WINDOW_S

RESIDUALS = ("first", "second")
BASIS = Basis(("one", "elapsed_s", "speed"))
SIGMA = 2.0
WIDE = Size("bias", "", -np.inf, np.inf)
BIAS = FaultModel("bias", (WIDE,), (Term("first", "one", 1.0), Term("second", "one", -0.5)))
DRIFT = FaultModel("drift", (WIDE,), (Term("first", "elapsed_s", 0.3),))
DRAG = FaultModel("drag", (WIDE,), (Term("second", "speed", 0.8),))
UNITS = np.zeros((2, 3, 1))
UNITS[:, 2, 0] = 0.4, 0.2
NOISE = LevelNoise(*np.array([[0.3, 0.2], [0.5, 0.1], [0.6, 0.8], [0.02, 0.05], [0.7, 0.4]]))
SIGNATURES = replace(
    FaultSignatures.of((BIAS, DRIFT, DRAG), RESIDUALS, BASIS, UNITS), reach=np.full((3, 1), SIGMA)
)


def drawn(count: int, noise: LevelNoise, seed: int) -> np.ndarray:
    """Residuals of this noise, shape (windows, residuals)."""
    draw = np.random.default_rng(seed)
    level = np.sqrt(noise.start) * draw.standard_normal(2)
    coloured = np.sqrt(noise.coloured) * draw.standard_normal(2)
    rows = []
    for _ in range(count):
        rows.append(level + coloured + np.sqrt(noise.white) * draw.standard_normal(2))
        level = level + np.sqrt(noise.walk) * draw.standard_normal(2)
        renewed = np.sqrt(noise.coloured * (1.0 - noise.phi**2))
        coloured = noise.phi * coloured + renewed * draw.standard_normal(2)
    return np.array(rows)


def windows(values: np.ndarray) -> list[ResidualWindow]:
    speed = np.sin(0.4 * np.arange(len(values)))
    return [
        ResidualWindow(row, np.tile([1.0, 0.0, v], (2, 1)))
        for row, v in zip(values, speed, strict=True)
    ]


def bank(noise: LevelNoise, values: np.ndarray) -> OnsetBank:
    made = OnsetBank(noise, SIGNATURES, memory_s=np.inf)
    for window in windows(values):
        made.add(window, begins=True)
    return made


def covariance(count: int, k: int) -> np.ndarray:
    """Of one residual over its windows, without the unit."""
    t = np.arange(count)
    level = NOISE.start[k] + NOISE.walk[k] * np.minimum(t, t[:, None])
    coloured = NOISE.coloured[k] * NOISE.phi[k] ** np.abs(t - t[:, None])
    return np.asarray(level + coloured + NOISE.white[k] * np.eye(count))


def test_ratios_are_those_of_dense_normal_densities() -> None:
    count, values = 12, drawn(12, NOISE, seed=1)
    values[5, 0] = values[9, 1] = np.nan
    found, known = bank(NOISE, values), np.isfinite(values).T.ravel()
    speed, y = np.sin(0.4 * np.arange(count)), values.T.ravel()[known]
    psi = np.concatenate((0.4 * speed, 0.2 * speed))
    noise = np.zeros((2 * count, 2 * count))
    noise[:count, :count], noise[count:, count:] = covariance(count, 0), covariance(count, 1)
    null = (noise + np.outer(psi, psi))[np.ix_(known, known)]
    for row, onset in enumerate(found.onsets.tolist()):
        since = (np.arange(count) >= onset).astype(float)
        elapsed = since * (np.arange(count) - onset + 0.5) * WINDOW_S
        effects = (
            np.concatenate((since, -0.5 * since)),
            np.concatenate((0.3 * elapsed, 0.0 * since)),
            np.concatenate((0.0 * since, 0.8 * since * speed)),
        )
        for nats, effect in zip(found.ratios()[row], effects, strict=True):
            spread = null + SIGMA**2 * np.outer(effect, effect)[np.ix_(known, known)]
            densities = [multivariate_normal(np.zeros(len(y)), c).logpdf(y) for c in (spread, null)]
            assert nats == pytest.approx(densities[0] - densities[1], abs=1e-8)


def test_a_step_in_coloured_noise_is_found_at_its_onset() -> None:
    values = drawn(160, NOISE, seed=2)
    values[101:] += 3.0 * np.array([1.0, -0.5])
    found = bank(NOISE, values[:120])
    onset, model = np.unravel_index(found.ratios().argmax(), found.ratios().shape)
    assert SIGNATURES.models[model].fault == "bias"
    assert abs(int(found.onsets[onset]) - 101) <= 2
    history, limits = WindowHistory(), np.full(3, 12.0)
    for window in windows(values):
        history.add(window)
    nats = history.evidence(RatioTest(SIGNATURES, NOISE, limits), 160 - 101).ratios()
    assert nats[0] > limits[0]
    assert nats[0] > max(nats[1:]) + 3.5


def test_what_is_in_the_windows_about_the_onset_alone_is_no_evidence() -> None:
    values = drawn(160, NOISE, seed=3)
    values[100:102] += 30.0
    assert bank(NOISE, values[:104]).ratios().max() > 100.0
    history = WindowHistory()
    for window in windows(values):
        history.add(window)
    assert history.evidence(RatioTest(SIGNATURES, NOISE, np.zeros(3)), 60).ratios().max() < 5.0


def test_a_drifting_level_is_no_fault() -> None:
    """What a walk explains, a model without one calls a fault."""
    quick = replace(NOISE, walk=np.array([0.05, 0.05]))
    steady = replace(NOISE, walk=np.zeros(2))
    most = [
        [bank(noise, drawn(150, quick, seed)).ratios().max() for seed in range(10)]
        for noise in (quick, steady)
    ]
    assert max(most[0]) < 8.0
    assert np.median(most[1]) > 12.0


def test_the_variogram_gives_back_the_noise() -> None:
    known = LevelNoise(*np.array([[0.3, 0.1], [0.8, 0.4], [0.8, 0.5], [0.02, 0.0], [1e-6, 1e-6]]))
    found = level_noise([drawn(400, known, seed) for seed in range(40)])
    np.testing.assert_allclose(found.white, known.white, rtol=0.3)
    np.testing.assert_allclose(found.coloured, known.coloured, rtol=0.3)
    np.testing.assert_allclose(found.walk, known.walk, atol=0.006)


def test_the_bank_keeps_few_onsets_and_the_recent_ones() -> None:
    made = bank(NOISE, drawn(400, NOISE, seed=4))
    ages = (made.windows - made.onsets) // 2
    assert len(ages) <= 24
    assert set(range(1, 8)) <= set(ages.tolist())
    assert ages.max() > 50
