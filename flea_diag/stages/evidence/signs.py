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

"""Signs of relations: by which sign each has deviated since an onset, for those who read."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]

SIGNED, LOUD = 3.0, 5.0
"""Standard deviations from which on a mean has a sign, and a mean square shows a deviation."""


def signs(count: Array, total: Array, squares: Array) -> list[str]:
    """Of each relation ``+``, ``-``, ``*`` where it alternates, or nothing where it is quiet.

    ``count`` of windows, sum and sum of squares of their standardised errors, each (relations,).
    """
    n = np.maximum(count, 1.0)
    mean = total / np.sqrt(n)
    louder = (squares - n) / np.sqrt(2.0 * n)
    kinds = np.where(np.abs(mean) > SIGNED, np.where(mean > 0.0, "+", "-"), "*")
    found: list[str] = np.where((np.abs(mean) > SIGNED) | (louder > LOUD), kinds, "").tolist()
    return found
