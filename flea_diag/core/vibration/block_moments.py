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

"""Second and fourth moment of a vibration block, cheap enough to run always."""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import cache

import numpy as np
import numpy.typing as npt

from flea_diag.core import backend as backends

Floats = npt.NDArray[np.float32]
Doubles = npt.NDArray[np.float64]
Moments = Callable[[Floats, int, int], Doubles]


@cache
def moments() -> Moments:
    """The compiled function where numba is installed, else that of numpy.

    Both take the fields of a block as float32 (count, 1 + axes), flat: time, which is left out, and
    one value per axis; then the number of axes, and that every so many points are used. They
    return (2, axes): standard deviation and kurtosis, about the mean of the points used. The
    kurtosis of a constant axis is 0. They agree to rounding in single precision.
    """
    compiled = backends.chosen("auto") == "numba"
    return backends.compiled(moments_loop) if compiled else moments_numpy


def try_out_moments() -> None:
    """Load what they need, so that the first block is not delayed by it."""
    moments()(np.frombuffer(bytes(16), np.float32), 1, 1)


def moments_loop(fields: Floats, axes: int, stride: int) -> Doubles:
    """As a loop, for numba."""
    step = stride * (1 + axes)
    count = (len(fields) + step - 1) // step
    row, found = np.empty(count, np.float32), np.empty((2, axes))
    for axis in range(axes):
        total = np.float64(0.0)
        for k in range(count):
            row[k] = fields[1 + axis + k * step]
            total += row[k]
        mean = np.float32(total / count)
        second = fourth = np.float32(0.0)
        for k in range(count):
            square = (row[k] - mean) * (row[k] - mean)
            second += square
            fourth += square * square
        variance = second / count
        found[0, axis] = math.sqrt(variance)
        found[1, axis] = fourth / count / (variance * variance) if variance else 0.0
    return found


def moments_numpy(fields: Floats, axes: int, stride: int) -> Doubles:
    """With numpy alone."""
    points = fields.reshape(-1, 1 + axes)[::stride, 1:]
    powers = points.T.copy()
    weight = _weight(len(points))
    powers -= powers.dot(weight)[:, None]
    powers *= powers
    second = powers.dot(weight).astype(np.float64)
    powers *= powers
    fourth = powers.dot(weight)
    squared = second * second
    kurtosis = np.divide(fourth, squared, out=np.zeros(axes), where=squared > 0.0)
    return np.stack((np.sqrt(second), kurtosis))


@cache
def _weight(points: int) -> Floats:
    """Of each point in a mean."""
    return np.full(points, 1.0 / points, dtype=np.float32)
