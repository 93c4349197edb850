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

"""Marginal likelihood ratio of faults: sizes and what the unit differs by integrated out.

With white residuals y = Phi theta + Psi eta + noise, eta ~ N(0, 1), theta ~ N(mean, sigma^2) cut
to its bounds,

    log p(y | fault) - log p(y | no fault)

has a closed form in the sums Phi' Phi, Phi' Psi, Phi' y, Psi' Psi and Psi' y. Of a model with
several sizes the share within the bounds is taken size by size, as if they were independent.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from flea_diag.core.evidence.fault_signatures import SizePrior

Array = npt.NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Sums:
    """Products of white signals, summed over residuals and windows.

    ``gram`` is Phi' Phi of each model, shape (..., models, sizes, sizes), ``cross`` is
    Phi' [y, Psi], shape (..., models, sizes, 1 + differences), and ``own`` [y, Psi]' [y, Psi],
    shape (1 + differences, 1 + differences).
    """

    gram: Array
    cross: Array
    own: Array

    @classmethod
    def of(cls, own: Array, white: Array) -> Sums:
        """Of windows: [y, Psi], shape (windows, residuals, 1 + differences), and Phi.

        Phi has shape (windows, residuals, models, sizes).
        """
        models, sizes = white.shape[2:]
        rows, phi = own.reshape(-1, own.shape[-1]), white.reshape(-1, models * sizes)
        by_model = phi.reshape(-1, models, sizes).transpose(1, 2, 0)
        gram = np.matmul(by_model, by_model.transpose(0, 2, 1))
        return cls(gram, (phi.T @ rows).reshape(models, sizes, -1), rows.T @ rows)

    @cached_property
    def without_unit(self) -> tuple[Array, Array, Array]:
        """Phi' Phi and Phi' y with the unit integrated out, and the covariance of the unit."""
        unit = np.asarray(np.linalg.inv(np.eye(len(self.own) - 1) + self.own[1:, 1:]), dtype=float)
        explained = np.matmul(self.cross[..., 1:], unit)
        A = self.gram - np.matmul(explained, np.swapaxes(self.cross[..., 1:], -1, -2))
        return A, self.cross[..., 0] - explained @ self.own[1:, 0], unit


class Posterior(NamedTuple):
    """Sizes of each model and their standard errors, shape (models, sizes).

    ``unit``: covariance of what the unit differs by.
    """

    size: Array
    sigma: Array
    unit: Array


def marginal_ratio(sums: Sums, prior: SizePrior, reaching: bool = False) -> Array:
    """Log ratios in nats, shape (..., models).

    ``reaching``: a size without a bound reaches as far as the data show it. Its scale is not known,
    so that it is larger than its prior makes it no less likely (empirical Bayes).
    """
    A, b, _ = sums.without_unit
    pull = np.matmul(A, prior.mean[..., None])[..., 0]
    known = ((b - 0.5 * pull) * prior.mean).sum(axis=-1)
    covariance, mean, scaled, inner = _solved(A, b - pull, prior)
    if reaching:
        unbounded = np.isinf(prior.low) | np.isinf(prior.high)
        farther = np.where(unbounded, np.abs(mean), 0.0)
        if (farther > 1.0).any():
            prior = replace(prior, sigma=prior.sigma * np.maximum(farther, 1.0))
            covariance, mean, scaled, inner = _solved(A, b - pull, prior)
    gain = 0.5 * ((scaled * mean).sum(axis=-1) - np.linalg.slogdet(inner)[1])
    return np.asarray(known + gain + _cut(mean, covariance, prior))


def posterior_mean(sums: Sums, prior: SizePrior) -> tuple[Array, Array]:
    """Sizes of each model held to their bounds, (models, sizes); units, (models, differences)."""
    found = posterior(sums, prior)
    left = sums.own[1:, 0] - np.einsum("fi,fid->fd", found.size, sums.cross[..., 1:])
    return found.size, left @ found.unit


def posterior(sums: Sums, prior: SizePrior) -> Posterior:
    """What the data say of the sizes of each model, held to their bounds."""
    A, b, unit = sums.without_unit
    pull = np.matmul(A, prior.mean[..., None])[..., 0]
    covariance, mean, _, _ = _solved(A, b - pull, prior)
    size = np.clip(prior.mean + prior.sigma * mean, prior.low, prior.high)
    variance = np.maximum(np.diagonal(covariance, axis1=-2, axis2=-1), 0.0)
    return Posterior(size, prior.sigma * np.sqrt(variance), unit)


def _solved(A: Array, b: Array, prior: SizePrior) -> tuple[Array, Array, Array, Array]:
    """Covariance and mean of the sizes in prior standard deviations, and what they solve."""
    b = prior.sigma * b
    A = np.eye(A.shape[-1]) + prior.sigma[..., :, None] * A * prior.sigma[..., None, :]
    covariance = np.asarray(np.linalg.inv(A), dtype=float)
    return covariance, np.matmul(covariance, b[..., None])[..., 0], b, A


def _cut(mean: Array, covariance: Array, prior: SizePrior) -> Array:
    """Log of the share within the bounds, after the data less before them."""
    low, high, before = _bounds(prior)
    errors = np.sqrt(np.maximum(np.diagonal(covariance, axis1=-2, axis2=-1), 1e-300))
    after = _share((low - mean) / errors, (high - mean) / errors)
    return np.asarray((after - before).sum(axis=-1))


def try_out_share() -> None:
    """Load what it needs, so that the first fault is not told later by it, nor a pause seen."""
    _share(np.array(-1.0), np.array(1.0))


@lru_cache(maxsize=16)
def _bounds(prior: SizePrior) -> tuple[Array, Array, Array]:
    """Bounds in prior standard deviations from the mean, and the log share within them."""
    sigma = np.where(prior.sigma > 0.0, prior.sigma, 1.0)
    low, high = (prior.low - prior.mean) / sigma, (prior.high - prior.mean) / sigma
    return low, high, _share(low, high)


def _share(low: Array, high: Array) -> Array:
    """Log probability of a standard normal variable between two values."""
    from scipy.special import log_ndtr  # slow to import, and few recordings raise a question

    swapped = low > -high  # the lower tail keeps its digits
    a, b = np.where(swapped, -high, low), np.where(swapped, -low, high)
    upper = log_ndtr(b)
    return np.asarray(upper + np.log1p(-np.exp(np.minimum(log_ndtr(a) - upper, -1e-15))))
