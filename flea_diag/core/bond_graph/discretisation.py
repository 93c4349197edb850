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

"""From continuous time to scans; stable for time constants below the scan period.

An Euler step of 10 ms over a time constant of 4 ms diverges. The linear part is therefore
integrated by exponentials, exact for inputs held over the period; what friction adds follows by the
two-stage exponential rule (Cox and Matthews 2002, ETD2RK; ``observers.motion_step``).
"""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]

SMALL, TERMS = 0.5, 14
"""Below it the series of phi2, with so many terms, is exact to the last digit."""


def expm(matrix: Array) -> Array:
    """Matrix exponential (scipy's, imported on first use)."""
    from scipy.linalg import expm as scipy_expm

    result: Array = scipy_expm(matrix)
    return result


def phi_functions(z: float) -> tuple[float, float]:
    """phi1(z) = (e^z - 1)/z and phi2(z) = (phi1 - 1)/z; by their series where these cancel."""
    if abs(z) < SMALL:
        two = sum(z**k / math.factorial(k + 2) for k in range(TERMS))
        return 1.0 + z * two, two
    one = math.expm1(z) / z
    return one, (one - 1.0) / z
