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

from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from flea_diag.core.likelihood.bounded_systems import BoundedSystems

Array = npt.NDArray[np.float64]


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
    """

    systems: BoundedSystems
    number: int
    design: Array
    means: Array

    def sigmas(self) -> tuple[float, ...]:
        """Standard error of each size."""
        (errors,) = self.systems.errors([self.number])
        return tuple(map(float, errors))

    def left(self) -> tuple[float, ...]:
        """Of each residual the sum of squares over block means that the unknowns leave."""
        effect = self.design @ self.systems.solutions[self.number]
        without = np.concatenate((np.ones((len(effect), 1)), -effect), axis=1)
        left = (without * np.matmul(self.means, without[..., None])[..., 0]).sum(axis=-1)
        return tuple(left.tolist())


@dataclass(frozen=True, slots=True)
class KnownErrors:
    """Standard errors that are known at once; what is left is told elsewhere."""

    errors: tuple[float, ...]

    def sigmas(self) -> tuple[float, ...]:
        """Standard error of each size."""
        return self.errors

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

    @property
    def left(self) -> tuple[float, ...]:
        """Of each residual the sum of squares over block means that the hypothesis leaves."""
        return self.solution.left() if self.solution else ()
