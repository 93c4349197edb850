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

"""What a fit of one fault model to an episode says."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from flea_diag.core.likelihood.bounded_systems import BoundedSystems
from flea_diag.core.likelihood.evidence_sums import EvidenceSums

Array = npt.NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class SizeError:
    """Standard error of a size, split by where it comes from; unit of the size.

    Attributes
    ----------
    own
        Of this recording alone: its noise, and what recordings of one unit differ by.
    from_unit
        What one standard deviation of each difference of a unit moves the size by. The difference
        is the same in all recordings of the unit, so these errors cancel between their sizes.
    """

    own: float
    from_unit: tuple[float, ...] = ()

    @property
    def shared(self) -> float:
        """Of the unit, the same in each of its recordings."""
        return math.hypot(*self.from_unit)

    @property
    def total(self) -> float:
        """Of the size of any unit of the design."""
        return math.hypot(self.own, self.shared)


@dataclass(frozen=True, eq=False, slots=True)
class Solution:
    """What one model was fitted to, as it was at the time.

    Attributes
    ----------
    systems, number
        The normal equations, and which of their models it is.
    design
        How sizes and unit parameters enter each residual, shape (residuals, signals, unknowns).
    means
        Of each residual the products of block means, shape (residuals, 1 + signals, 1 + signals).
    weight
        Of a squared residual, shape (residuals,).
    tolerance
        What healthy units differ by, one sigma each, shape (differences,).
    """

    systems: BoundedSystems
    number: int
    design: Array
    means: Array
    weight: Array
    tolerance: Array

    def errors(
        self, run_share: Array, pieces: Sequence[EvidenceSums] = ()
    ) -> tuple[SizeError, ...]:
        """Error of each size, split; ``run_share`` as in ``Weights``.

        The prior of what the unit differs by has the information ``L``, so its error enters the
        solution by ``A^-1 L``: with ``L^-1`` as covariance, a size has ``(A^-1)_sj / tolerance_j``
        of one standard deviation of difference j. What is left of its variance is of the noise.
        Where the ``pieces`` of the evidence are given, their scatter says what that is.
        """
        inverse, count = self.systems.inverse(self.number), len(self._sizes)
        moved = inverse[:count, self.systems.count :] / self.tolerance
        noise = np.diagonal(inverse)[:count] - np.square(moved).sum(axis=1)
        if pieces:
            noise = np.square(inverse[:count] @ self._scores(pieces)).sum(axis=1)
        own = np.maximum(noise, 0.0) + np.square(moved) @ run_share
        lasting = moved * np.sqrt(1.0 - run_share)
        return tuple(
            SizeError(math.sqrt(float(variance)), tuple(map(float, row)))
            for variance, row in zip(own, lasting, strict=True)
        )

    def _scores(self, pieces: Sequence[EvidenceSums]) -> Array:
        """What each piece of the evidence would move the unknowns by, shape (unknowns, pieces).

        By their scatter errors are those of the noise as it is, coloured or not (White 1980, of
        clusters Liang and Zeger 1986); the prior is of no piece.
        """
        effect = self.design @ self.systems.solutions[self.number]
        weighed = self.weight[:, None, None] * self.design
        left = [p.cross - np.matmul(p.gram, effect[..., None])[..., 0] for p in pieces]
        return np.array([np.einsum("rsu,rs->u", weighed, of_piece) for of_piece in left]).T

    def sigmas(self) -> tuple[float, ...]:
        """Standard error of each size."""
        (errors,) = self.systems.errors([self.number])
        return tuple(errors[: len(self._sizes)].tolist())

    @property
    def _sizes(self) -> tuple[float, ...]:
        return self.systems.sizes(self.number)

    def left(self) -> tuple[float, ...]:
        """Of each residual the sum of squares over block means that the unknowns leave."""
        effect = self.design @ self.systems.solutions[self.number]
        without = np.concatenate((np.ones((len(effect), 1)), -effect), axis=1)
        left = (without * np.matmul(self.means, without[..., None])[..., 0]).sum(axis=-1)
        return tuple(left.tolist())


@dataclass(frozen=True, slots=True)
class KnownErrors:
    """Standard errors that are known at once; what is left is told elsewhere."""

    known: tuple[float, ...]

    def sigmas(self) -> tuple[float, ...]:
        """Standard error of each size."""
        return self.known

    def errors(self, run_share: Array) -> tuple[SizeError, ...]:
        """Not told here."""
        return ()

    def left(self) -> tuple[float, ...]:
        """Not told here."""
        return ()


@dataclass(frozen=True, slots=True)
class Fit:
    """One hypothesis against the window: log-likelihood ratio and sizes.

    An episode is fitted every half second and seldom reported: ``solution`` computes standard
    errors and what the fit leaves when they are asked for.
    """

    fault: str
    log_likelihood: float
    sizes: tuple[float, ...]
    solution: Solution | KnownErrors | None = field(default=None, compare=False, repr=False)

    @property
    def sigmas(self) -> tuple[float, ...]:
        """Standard error of each size; none without a solution."""
        return self.solution.sigmas() if self.solution else ()

    def errors(self, run_share: Array) -> tuple[SizeError, ...]:
        """Error of each size, split by where it comes from; none without a solution."""
        return self.solution.errors(run_share) if self.solution else ()

    @property
    def left(self) -> tuple[float, ...]:
        """Of each residual the sum of squares over block means that the hypothesis leaves."""
        return self.solution.left() if self.solution else ()
