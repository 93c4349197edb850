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
        root = np.linalg.cholesky(total + 1e-12 * np.diag(np.diag(total)))
        inner = np.eye(len(root)) + root.T @ beside.gram @ root
        pulled = np.matmul(beside.cross, root)
        explained = np.einsum(
            "...i,...i->...", pulled, np.linalg.solve(inner, pulled[..., None])[..., 0]
        )
        log_det = np.linalg.slogdet(inner)[1]
        return np.asarray(sums.log_scale - 0.5 * (beside.square - explained + log_det))


def mean_of(sums: RunSums, variance: Array, prior: Array) -> tuple[Array, Array]:
    """Mean of the coefficients and its covariance; ``prior``: variances of the mean."""
    freed = sums.freed(variance)
    covariance = np.linalg.inv(np.diag(1.0 / prior) + freed.gram.sum(axis=0))
    return covariance @ freed.cross.sum(axis=0), covariance


def fitted(
    sums: RunSums,
    variance: Array,
    mean_prior: Array,
    groups: Array | None = None,
    steps: int = STEPS,
    start: Array | None = None,
) -> Spread:
    """Spread of recordings; ``variance`` is A^2, shape (columns,).

    Parameters
    ----------
    groups
        Unit of each recording, shape (recordings,): each has a mean of its own, and the mean that
        is returned is that of the first. None: all are of one unit.
    start
        Variances to start from.
    """
    found = variance.copy() if start is None else start.copy()
    groups = np.zeros(len(sums), dtype=int) if groups is None else groups
    members = [np.flatnonzero(groups == unit) for unit in np.unique(groups)]
    for _ in range(steps):
        total = 2.0 * variance * found / (variance + found)
        for which in members:
            total = total + _squares(sums[which], found, mean_prior)
        found = total / (PRIOR_RUNS + len(sums))
    mean, covariance = mean_of(sums[members[0]], found, mean_prior)
    return Spread(mean, found, covariance)


def _squares(sums: RunSums, variance: Array, mean_prior: Array) -> Array:
    """Expected squares of what recordings of one unit differ by, summed."""
    mean, covariance = mean_of(sums, variance, mean_prior)
    kept, _ = posterior_covariance(sums.gram, variance)
    apart = np.matmul(kept, sums.beside(mean).cross[..., None])[..., 0]
    pull = np.matmul(kept, sums.gram)
    of_mean = np.einsum("kij,jl,kil->i", pull, covariance, pull)
    own = np.einsum("kii->i", kept)
    return np.asarray(np.square(apart).sum(axis=0) + own + of_mean)


def without_each(sums: RunSums, spread: Spread, mean_prior: Array) -> list[Spread]:
    """The spread without each recording in turn, in closed form.

    Its own share is taken off the sums for mean and variance.
    """
    freed = sums.freed(spread.variance)
    information = np.diag(1.0 / mean_prior) + freed.gram.sum(axis=0)
    vector = freed.cross.sum(axis=0)
    apart, kept = spread.posterior(sums)
    own = np.square(apart) + np.einsum("kii->ki", kept)
    count = PRIOR_RUNS + len(sums)
    made = []
    for k in range(len(sums)):
        covariance = np.linalg.inv(information - freed.gram[k])
        variance = np.maximum(count * spread.variance - own[k], 0.0) / (count - 1.0)
        made.append(Spread(covariance @ (vector - freed.cross[k]), variance, covariance))
    return made
