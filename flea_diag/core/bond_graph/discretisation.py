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
integrated by matrix exponentials, exact for inputs held over the period; what friction adds follows
by the two-stage exponential rule (Cox and Matthews 2002, ETD2RK; ``observers.motion_step``).
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]


def expm(matrix: Array) -> Array:
    """Matrix exponential (scipy's, imported on first use)."""
    from scipy.linalg import expm as scipy_expm

    result: Array = scipy_expm(matrix)
    return result


def phi_functions(a: Array, step_s: float) -> tuple[Array, Array]:
    """phi1(Ah) = (e^Ah - 1)/(Ah) and phi2(Ah) = (phi1 - 1)/(Ah), safe for singular A."""
    n = len(a)
    block = np.zeros((3 * n, 3 * n))
    block[:n, :n] = a * step_s
    block[:n, n : 2 * n] = block[n : 2 * n, 2 * n :] = np.eye(n)
    grown = expm(block)
    return grown[:n, n : 2 * n], grown[:n, 2 * n :]
