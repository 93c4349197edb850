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

"""The closed form of the marginal ratio, against dense normal densities and quadrature."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.stats import multivariate_normal, norm

from flea_diag.core.evidence.fault_signatures import SizePrior
from flea_diag.core.evidence.marginal_ratio import Sums, marginal_ratio, posterior_mean

ROWS, UNITS, MODELS, SIZES = 14, 3, 2, 2
DRAW = np.random.default_rng(5)
Y = DRAW.standard_normal(ROWS) + 0.7
PSI = DRAW.standard_normal((ROWS, UNITS))
PHI = DRAW.standard_normal((ROWS, MODELS, SIZES))
MEAN, SIGMA = np.array([[0.5, -1.0], [2.0, 0.0]]), np.array([[1.5, 0.3], [4.0, 2.0]])
FREE = np.full((MODELS, SIZES), np.inf)
NULL = np.eye(ROWS) + PSI @ PSI.T


def sums() -> Sums:
    return Sums.of(np.column_stack((Y, PSI))[:, None], PHI[:, None])


def test_without_bounds_it_is_the_ratio_of_two_normal_densities() -> None:
    found = marginal_ratio(sums(), SizePrior(MEAN, SIGMA, -FREE, FREE))
    healthy = multivariate_normal(np.zeros(ROWS), NULL).logpdf(Y)
    for k in range(MODELS):
        spread = NULL + PHI[:, k] @ np.diag(SIGMA[k] ** 2) @ PHI[:, k].T
        faulty = multivariate_normal(PHI[:, k] @ MEAN[k], spread).logpdf(Y)
        assert found[k] == pytest.approx(faulty - healthy, abs=1e-9)


def test_the_posterior_mean_is_that_of_the_normal_model() -> None:
    theta, eta = posterior_mean(sums(), SizePrior(MEAN, SIGMA, -FREE, FREE))
    for k in range(MODELS):
        inverse = np.linalg.inv(NULL)
        A = PHI[:, k].T @ inverse @ PHI[:, k] + np.diag(SIGMA[k] ** -2)
        b = PHI[:, k].T @ inverse @ Y + MEAN[k] / SIGMA[k] ** 2
        np.testing.assert_allclose(theta[k], np.linalg.solve(A, b), rtol=1e-9)
        left = Y - PHI[:, k] @ theta[k]
        np.testing.assert_allclose(eta[k], PSI.T @ inverse @ left, rtol=1e-9)


@pytest.mark.parametrize(("low", "high"), [(0.0, np.inf), (0.2, 0.9), (-4.0, -1.0)])
def test_bounds_of_one_size_cut_its_prior(low: float, high: float) -> None:
    phi = PHI[:, :1, :1]
    mean, sigma = np.array([[0.3]]), np.array([[1.2]])
    prior = SizePrior(mean, sigma, np.array([[low]]), np.array([[high]]))
    (found,) = marginal_ratio(Sums.of(np.column_stack((Y, PSI))[:, None], phi[:, None]), prior)
    density = multivariate_normal(np.zeros(ROWS), NULL)
    size = norm(0.3, 1.2)
    share = size.cdf(high) - size.cdf(low)

    def weighed(theta: float) -> float:
        ratio = density.logpdf(Y - phi[:, 0, 0] * theta) - density.logpdf(Y)
        return float(np.exp(ratio) * size.pdf(theta) / share)

    expected, _ = quad(weighed, low, min(high, 12.0), limit=200)
    assert found == pytest.approx(np.log(expected), abs=1e-6)


def test_a_size_without_a_bound_reaches_as_far_as_the_data_show_it() -> None:
    phi, size = np.ones((ROWS, 1, 1)), 1000.0
    blank, free = np.zeros((1, 1)), np.full((1, 1), np.inf)

    def ratio(sigma: float, least: float, far: bool) -> float:
        prior = SizePrior(blank, np.full((1, 1), sigma), np.full((1, 1), least), free)
        own = np.column_stack((Y + size, PSI))[:, None]
        return float(marginal_ratio(Sums.of(own, phi[:, None]), prior, reaching=far)[0])

    assert ratio(1.0, -np.inf, far=False) < ratio(size, -np.inf, far=False) - 1000.0
    assert ratio(1.0, -np.inf, far=True) == pytest.approx(ratio(size, -np.inf, False), abs=0.1)
    assert ratio(size, 0.0, far=True) == pytest.approx(ratio(size, 0.0, far=False), abs=0.1)
