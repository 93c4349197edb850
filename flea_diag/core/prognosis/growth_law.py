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

"""Laws by which a fault grows: one family, in which each law is a row.

Growth that feeds on the size, ``da/dt = c a^p``, is a straight line in

    f(a) = (a^(1 - p) - 1) / (1 - p) ,      f(a) = ln a  for p = 1

(Box and Cox 1964), so a law is known from its sizes at two times. p = 0 is steady wear, p = 1
growth in proportion to the size, and p = m / 2 the law of Paris and Erdogan (1963) for a crack of
length a, ``da/dN = C (dK)^m`` with ``dK`` in proportion to the root of a; m = 3 is usual for
steels.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]


@dataclass(frozen=True)
class GrowthLaw:
    """``power`` is p."""

    name: str
    power: float

    def straight(self, sizes: Array | float) -> Array:
        """What grows in a straight line, of sizes above 0."""
        left = 1.0 - self.power
        sizes = np.asarray(sizes, dtype=float)
        return np.log(sizes) if left == 0.0 else (sizes**left - 1.0) / left

    def size(self, straight: Array) -> Array:
        """Sizes of that; infinite where the law has grown beyond all bounds, 0 below all sizes."""
        left = 1.0 - self.power
        if left == 0.0:
            return np.asarray(np.exp(np.minimum(straight, 700.0)))
        base = np.maximum(1.0 + left * straight, 0.0)
        with np.errstate(divide="ignore"):
            return np.asarray(base ** (1.0 / left))


LAWS = (GrowthLaw("linear", 0.0), GrowthLaw("exponential", 1.0), GrowthLaw("Paris", 1.5))
"""A further law of growth is a row."""
