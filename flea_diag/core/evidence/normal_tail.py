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

"""Log probability below a value, of a standard normal variable.

scipy.special has it too (``log_ndtr``) and takes longer to import than a minute of scans to judge.
"""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]

FAR = -37.0
"""Below it the probability is near the smallest number, and its asymptotic series exact."""
LOG_ROOT = 0.5 * math.log(2.0 * math.pi)


def log_below(values: Array) -> Array:
    """Natural logarithms, of the shape of the values; NaN where they are."""
    found = np.where(values > 0.0, 0.0, -np.inf)
    inside = ~np.isinf(values)
    found[inside] = [_log_below(value) for value in values[inside].tolist()]
    return found


def _log_below(x: float) -> float:
    if x > 0.0:
        return math.log1p(-0.5 * math.erfc(x * math.sqrt(0.5)))
    if x > FAR:
        return math.log(0.5 * math.erfc(-x * math.sqrt(0.5)))
    u = 1.0 / (x * x)
    rest = u * (1.0 - 3.0 * u * (1.0 - 5.0 * u * (1.0 - 7.0 * u)))
    return math.log1p(-rest) - 0.5 * x * x - math.log(-x) - LOG_ROOT
