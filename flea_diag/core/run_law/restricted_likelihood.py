"""Variances between recordings by restricted maximum likelihood, with a prior, in closed steps.

The coefficients of recording k are b_k = m + c_k, c_k ~ N(0, S), S diagonal, m ~ N(0, M). With the
sums of each recording (``run_sums``) the EM algorithm (Laird and Ware 1982) needs no data:

    S = (sum_k E[c_k^2] + 2 A^2 S / (A^2 + S)) / (K + 1)

where E[c_k^2] holds the uncertainty of m, which makes it restricted likelihood. The second term is
that of a half-Cauchy prior of the standard deviation with the scale A (Gelman 2006): what few
recordings say little of stays about A, and many bring it down as far as they like.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from flea_diag.core.run_law.run_sums import RunSums, posterior_covariance

Array = npt.NDArray[np.float64]
Places = npt.NDArray[np.intp]

STEPS = 40
"""Steps of EM: the log likelihood of the FLEA's recordings then changes by less than 0.01."""
PRIOR_RUNS = 1.0
"""Recordings that the prior of a variance counts as."""


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
    sums: RunSums, scale: Array, mean_prior: Array, groups: Places, steps: int = STEPS
) -> Array:
    """Variances between recordings of one unit, shape (columns,); ``scale`` is A^2.

    ``groups`` is the unit of each recording, shape (recordings,): each has a mean of its own.
    """
    found = scale.copy()
    members = [np.flatnonzero(groups == unit) for unit in np.unique(groups)]
    for _ in range(steps):
        total = 2.0 * scale * found / (scale + found)
        for which in members:
            total = total + _squares(sums[which], found, mean_prior)
        found = total / (PRIOR_RUNS + len(sums))
    return np.asarray(found)


def _squares(sums: RunSums, variance: Array, mean_prior: Array) -> Array:
    """Expected squares of what recordings of one unit differ by, summed."""
    mean, covariance = mean_of(sums, variance, mean_prior)
    kept, _ = posterior_covariance(sums.gram, variance)
    apart = np.matmul(kept, sums.beside(mean).cross[..., None])[..., 0]
    pull = np.matmul(kept, sums.gram)
    of_mean = np.einsum("kij,jl,kil->i", pull, covariance, pull)
    own = np.einsum("kii->i", kept)
    return np.asarray(np.square(apart).sum(axis=0) + own + of_mean)
