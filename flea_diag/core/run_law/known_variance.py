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

"""How well variances between recordings are known: what a claim is to be held against.

A variance that few recordings show may well be larger. Let d(S) be by how many nats the variance S
is less likely than the most likely one. A coefficient x is then d(S) + x^2 / 2 S nats out, by the S
that explains it best; of many like recordings that is Student's distribution. The normal one that
agrees with it ``CLAIM_NATS`` out has the variance

    S' = max over S of S (1 - d(S) / CLAIM_NATS)

So what no other recording shows stays about its prior, with the tail of that.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt

from flea_diag.core.run_law.variance_prior import VariancePrior

Array = npt.NDArray[np.float64]

CLAIM_NATS = 10.0
"""Evidence at which anything is claimed of a recording: limits lie between 9 and 15 nats."""
TRIED = np.logspace(-6.0, 4.0, 161)
"""Variances that are tried, over the square of the scale of their prior; 15 % apart."""
LEAST_TOLD = 1e-9
"""Share of its prior variance below which a recording says nothing of a coefficient."""


@dataclass(frozen=True, eq=False)
class KnownVariance:
    """What recordings, each by itself, say of their coefficients: c ~ N(0, S + 1 / information).

    ``square`` is c^2 times the information; shape (recordings, columns).
    """

    square: Array
    information: Array
    prior: VariancePrior

    @classmethod
    def of(cls, apart: Array, error: Array, variance: Array, prior: VariancePrior) -> KnownVariance:
        """From means and variances after the recordings, given the variance between them."""
        told = 1.0 - error / np.where(variance > 0.0, variance, np.inf)
        says = told > LEAST_TOLD
        told, error = np.where(says, told, 1.0), np.where(says, error, 1.0)
        square = np.where(says, np.square(apart) / (told * error), 0.0)
        return cls(square, np.where(says, told / error, 0.0), prior)

    @cached_property
    def _tried(self) -> Array:
        """Variances that are tried, shape (tried, columns)."""
        return TRIED[:, None] * self.prior.scale

    @cached_property
    def _each(self) -> Array:
        """Log likelihood of each, shape (recordings, tried, columns)."""
        grown = 1.0 + self._tried * self.information[:, None]
        return np.asarray(-0.5 * (np.log(grown) + self.square[:, None] / grown))

    @cached_property
    def _nats(self) -> Array:
        """By all recordings and the prior, shape (tried, columns)."""
        return np.asarray(self._each.sum(axis=0) + self.prior.log_density(self._tried))

    def _without(self, run: int) -> Array:
        return np.asarray(self._nats - self._each[run]) if run >= 0 else self._nats

    def likely(self, without: int = -1) -> Array:
        """The most likely variances, by their logarithm, shape (columns,)."""
        nats = self._without(without) + 0.5 * np.log(TRIED)[:, None]
        return np.asarray(np.take_along_axis(self._tried, nats.argmax(axis=0)[None], 0)[0])

    def wide(self, without: int = -1) -> Array:
        """Variances of the normal distributions that a claim is held against, shape (columns,)."""
        nats = self._without(without)
        less = nats.max(axis=0) - nats
        return np.asarray((self._tried * (1.0 - less / CLAIM_NATS)).max(axis=0))
