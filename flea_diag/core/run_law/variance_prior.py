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

"""What is known of a variance between recordings before any of them.

A description states what units differ by; recordings of one unit differ by that at most, about: the
prior of the standard deviation is half-normal. How much a relation neglects is a guess: there it is
half-Cauchy (Gelman 2006), which lets a variance be far larger. Neither keeps it from coming down.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]
Flags = npt.NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class VariancePrior:
    """Square of the scale of each standard deviation, and where it is a guess; shape (columns,)."""

    scale: Array
    guessed: Flags

    def log_density(self, variance: Array) -> Array:
        """Of the standard deviation, constants left out; variances of shape (..., columns)."""
        share = variance / self.scale
        return np.asarray(np.where(self.guessed, -np.log1p(share), -0.5 * share))

    def mode(self, squares: Array, count: int, before: Array) -> Array:
        """Variance that is most likely, by the logarithm, with squares summed over recordings.

        Where the prior is half-Cauchy one step towards it from the variance ``before``.
        """
        guess = (squares + 2.0 * self.scale * before / (self.scale + before)) / (count + 1.0)
        less = count - 1.0
        root = np.sqrt(less**2 + 4.0 * squares / self.scale)
        return np.asarray(np.where(self.guessed, guess, 2.0 * squares / (less + root)))
