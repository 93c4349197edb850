"""Standard deviation and kurtosis of each axis of one vibration block, cheap enough to run always.

Stronger vibration raises the first. Impacts, as of balls passing a pit, raise the second, which has
no unit and depends neither on the gain of the sensor nor on the level of the unit.
"""

from __future__ import annotations

import math
from functools import lru_cache

import numpy as np
import numpy.typing as npt

from flea_diag.wire.records import VibrationBlock

POINTS = 500
"""Points used of each block, evenly spread: of 2000 every fourth. On noise the standard deviation
is then accurate to 3 %, the kurtosis to 0.22; one impact rings for 20 of them."""

POINT = np.dtype("<f4")
"""Type of one field of a point; a point is its time and one value per axis, of equal size."""

Floats = npt.NDArray[np.float32]
Values = tuple[float, ...]


def condition_indicators(block: VibrationBlock) -> tuple[Values, Values]:
    """Standard deviation (m/s^2) and kurtosis (3 for Gaussian noise), one value per axis each.

    Both about the mean of the block, so that gravity and an offset cancel. The kurtosis of a
    constant axis is 0, a value that no signal has.
    """
    shape, strides, weight = _spread(block.count, len(block.axes))
    # The time of a point is its first field; skipping it leaves one plain matrix.
    points = np.ndarray(shape, POINT, block.data, POINT.itemsize, strides)
    powers = points.T.copy()
    powers -= (powers @ weight)[:, None]
    powers *= powers
    second = (powers @ weight).tolist()
    powers *= powers
    fourth = (powers @ weight).tolist()
    kurtosis = tuple([v4 / (v2 * v2) if v2 else 0.0 for v2, v4 in zip(second, fourth, strict=True)])
    return tuple(map(math.sqrt, second)), kurtosis


@lru_cache(maxsize=8)
def _spread(count: int, axes: int) -> tuple[tuple[int, int], tuple[int, int], Floats]:
    """Shape and strides of the points used of a block, and the weight of each in a mean."""
    stride = max(count // POINTS, 1)
    points = len(range(0, count, stride))
    size = POINT.itemsize
    weight = np.full(points, 1.0 / points, dtype=np.float32)
    return (points, axes), (stride * (1 + axes) * size, size), weight
