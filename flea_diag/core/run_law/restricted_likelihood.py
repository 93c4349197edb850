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

"""Variances between recordings by restricted maximum likelihood, with a prior, in closed steps.

The coefficients of recording k are b_k = m + c_k, c_k ~ N(0, S), S diagonal, m ~ N(0, M). With the
sums of each recording (``run_sums``) the EM algorithm (Laird and Ware 1982) needs no data:

    S = argmax_S  log p(S) - (K log S + sum_k E[c_k^2] / S) / 2

where E[c_k^2] holds the uncertainty of m, which makes it restricted likelihood. What recordings say
little of stays about its prior (``variance_prior``), and many bring it down as far as they like.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from flea_diag.core.run_law.run_sums import RunSums, posterior_covariance
from flea_diag.core.run_law.variance_prior import VariancePrior

Array = npt.NDArray[np.float64]
Places = npt.NDArray[np.intp]

STEPS = 40
"""Steps of EM: the log likelihood of the FLEA's recordings then changes by less than 0.01."""

CERTAIN = 1e-12
"""Share of its variance below which the error of a coefficient is rounding."""


@dataclass(frozen=True, eq=False)
class Spread:
    """Mean and variances of coefficients, shape (columns,), and the covariance of the mean."""

    mean: Array
    variance: Array
    covariance: Array

    def posterior(self, sums: RunSums) -> tuple[Array, Array]:
        """Mean and covariance of what one recording, or each of many, differs by."""
        kept, _ = posterior_covariance(sums.gram, self.variance)
        return np.matmul(kept, sums.beside(self.mean).cross[..., None])[..., 0], kept

    def log_density(self, sums: RunSums) -> Array:
        """Log density of further recordings, each by itself, constants left out."""
        beside = sums.beside(self.mean)
        total = np.diag(self.variance) + self.covariance
        values, vectors = np.linalg.eigh(total)
        root = vectors * np.sqrt(np.maximum(values, 0.0))
        inner = np.eye(len(root)) + root.T @ beside.gram @ root
        pulled = np.matmul(beside.cross, root)
        solved = np.linalg.solve(inner, pulled[..., None])[..., 0]
        explained = (pulled * solved).sum(axis=-1)
        log_det = np.linalg.slogdet(inner)[1]
        return np.asarray(sums.log_scale - 0.5 * (beside.square - explained + log_det))


def mean_of(sums: RunSums, variance: Array, prior: Array) -> tuple[Array, Array]:
    """Mean of the coefficients and its covariance; ``prior``: variances of the mean."""
    freed = sums.freed(variance)
    covariance = np.linalg.inv(np.diag(1.0 / prior) + freed.gram.sum(axis=0))
    return covariance @ freed.cross.sum(axis=0), covariance


def run_variance(
    sums: RunSums, prior: VariancePrior, mean_prior: Array, groups: Places, steps: int = STEPS
) -> Array:
    """Variances between recordings of one unit, shape (columns,).

    ``groups`` is the unit of each recording, shape (recordings,): each has a mean of its own.
    """
    found = prior.scale.copy()
    for _ in range(steps):
        apart, error = run_estimates(sums, found, mean_prior, groups)
        found = prior.mode((np.square(apart) + error).sum(axis=0), len(sums), found)
    return np.asarray(found)


def run_estimates(
    sums: RunSums, variance: Array, mean_prior: Array, groups: Places
) -> tuple[Array, Array]:
    """What each recording differs by from its unit, and the variance of that.

    Shape (recordings, columns); the uncertainty of the mean is in it.
    """
    apart, error = np.empty(sums.cross.shape), np.empty(sums.cross.shape)
    kept, _ = posterior_covariance(sums.gram, variance)
    for unit in np.unique(groups):
        which = np.flatnonzero(groups == unit)
        mean, covariance = mean_of(sums[which], variance, mean_prior)
        apart[which] = np.matmul(kept[which], sums[which].beside(mean).cross[..., None])[..., 0]
        pull = np.matmul(kept[which], sums.gram[which])
        error[which] = np.einsum("kii->ki", kept[which])
        error[which] += np.einsum("kij,jl,kil->ki", pull, covariance, pull)
    # Where hardly any noise makes a coefficient certain, rounding may leave an error below 0.
    return apart, np.maximum(error, CERTAIN * variance)
