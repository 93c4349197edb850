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

"""All tests of residuals that see every scan, in one compiled call: the same bits as apart."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from flea_diag.core.detection.mean_shift_loops import (
    MEAN_SHIFT_LOOPS,
    ShiftInput,
    mean_shift_test_loops,
)
from flea_diag.core.detection.z_test_loops import Z_TEST_LOOPS, Group, z_test_loops

Array = npt.NDArray[np.float64]
Flags = npt.NDArray[np.bool_]


def residual_test_loops(
    rows: tuple[Array, Array, Array, Array], moving: Flags, groups: tuple[Group, Group],
    results: Array, shift: ShiftInput,
) -> bool:  # fmt: skip
    """Z-tests, then mean-shift tests; whether any shift is beyond its limit."""
    z_test_loops(rows, moving, groups, results)
    judges, place, tests, memory, found = shift
    table = rows[0], rows[3], moving
    return judges and mean_shift_test_loops(table, place, tests, memory, found)


RESIDUAL_TEST_LOOPS = (residual_test_loops, *Z_TEST_LOOPS, *MEAN_SHIFT_LOOPS)
"""What ``backend.exact`` takes: the function, and what it calls."""
