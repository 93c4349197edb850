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

"""Windows of a stream in which it is asked what comes and goes."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt

from flea_diag.core.frozen import Frozen

Array = npt.NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class StreamPart(Frozen):
    """Windows of a stream since something was first far out.

    Attributes
    ----------
    errors
        See ``WindowRow``, shape (n, relations).
    faults
        Shape (n, relations, models, sizes).
    units
        What another unit adds, shape (n, relations, differences).
    ways
        Directions of motion and of the load, -1, 0 or 1, shape (n, signals).
    jumps
        By how much each reading has jumped at most, shape (n, readings).
    """

    errors: Array
    faults: Array
    units: Array
    ways: Array
    jumps: Array

    @cached_property
    def far(self) -> Array:
        """Standard deviations that the farthest relation is out, shape (n,)."""
        return np.asarray(np.abs(self.errors).max(axis=1))
