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

"""Sizes of one fault in recordings of one unit, with errors that are split by where they come from.

What a unit differs by from the design moves the sizes of all its recordings alike. With ``D`` the
variances of each recording alone and a column of ``L`` for each difference of a unit, the sizes
have the covariance

    C = s^2 D + L L' ,

so a difference between two recordings is far better known than either size. ``s`` is by how much
recordings scatter more or less than stated.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from flea_diag.core.likelihood.fit import SizeError

Array = npt.NDArray[np.float64]

STATED_FREEDOM = 4.0
"""Degrees of freedom that stated own errors count as, beside the scatter that a series shows."""
FREE = 1e3
"""By how much an offset that nothing is known of may be larger than all sizes of the new unit."""
FALLS_BY = 4.0
"""Own errors of a difference by which a size falls from one recording to the next only if something
was done to the unit: one fall in 30 000 by the noise."""


@dataclass(frozen=True, eq=False)
class SizeSeries:
    """Sizes in the order of their times, n at least 1.

    Attributes
    ----------
    times
        Shape (n,), s.
    sizes, own
        Shape (n,), unit of the size; own errors, one sigma.
    from_unit
        Shape (n, differences): errors of the unit, as of ``SizeError``.
    """

    times: Array
    sizes: Array
    own: Array
    from_unit: Array

    @staticmethod
    def of(
        times: Sequence[float], sizes: Sequence[float], errors: Sequence[SizeError]
    ) -> SizeSeries:
        """From one entry a recording; errors of the unit with the same differences in each."""
        return SizeSeries(
            np.asarray(times, dtype=float),
            np.asarray(sizes, dtype=float),
            np.array([error.own for error in errors]),
            np.array([error.from_unit for error in errors]).reshape(len(errors), -1),
        )

    def __len__(self) -> int:
        return len(self.times)

    def part(self, which: slice) -> SizeSeries:
        """Some of the recordings."""
        of = (self.times, self.sizes, self.own, self.from_unit)
        return SizeSeries(*(column[which] for column in of))

    def covariance(self, scale: float = 1.0) -> Array:
        """``C`` with ``s`` = ``scale``, shape (n, n)."""
        return np.asarray(np.diag(np.square(scale * self.own)) + self.from_unit @ self.from_unit.T)


def fitted(series: SizeSeries, design: Array, scale: float = 1.0) -> tuple[Array, Array]:
    """Coefficients of the columns of a design, shape (n, m), and their covariance."""
    whitener = np.linalg.inv(np.linalg.cholesky(series.covariance(scale)))
    rows = whitener @ design
    covariance = np.asarray(np.linalg.inv(rows.T @ rows), dtype=np.float64)
    return covariance @ rows.T @ whitener @ series.sizes, covariance


def scatter(series: SizeSeries, design: Array) -> float:
    """``s`` by what a design leaves, beside the stated errors as ``STATED_FREEDOM``."""
    found, _ = fitted(series, design)
    left = series.sizes - design @ found
    square = float(left @ np.linalg.solve(series.covariance(), left))
    freedom = len(series) - design.shape[1]
    return math.sqrt((STATED_FREEDOM + square) / (STATED_FREEDOM + freedom))


def against_new(series: SizeSeries, new: SizeSeries) -> SizeSeries:
    """The same sizes, once recordings of the ``new`` unit, without the fault, have been seen.

    There the size is 0: what was estimated is the error, and tells what the unit differs by. What a
    relation neglects in the motion of its test acts alike in all recordings too, and no error
    states it: so the offset of all of them is free, beside the differences of the unit. With
    ``C`` that of the new recordings, the differences ``z`` have the mean ``L' C^-1 y`` and the
    covariance ``1 - L' C^-1 L``, which takes the place of 1. By how much new recordings scatter
    more or less than stated, all do.
    """
    scale = scatter(new, np.ones((len(new), 1)))
    free = FREE * math.hypot(float(np.abs(new.sizes).max()), float(new.own.max()))
    series, new = (_with_offset(each, scale, free) for each in (series, new))
    gain = np.linalg.solve(new.covariance(), new.from_unit).T
    mean = gain @ new.sizes
    left = np.eye(new.from_unit.shape[1]) - gain @ new.from_unit
    values, vectors = np.linalg.eigh(0.5 * (left + left.T))
    root = vectors * np.sqrt(np.maximum(values, 0.0))
    return replace(
        series, sizes=series.sizes - series.from_unit @ mean, from_unit=series.from_unit @ root
    )


def _with_offset(series: SizeSeries, scale: float, free: float) -> SizeSeries:
    """Own errors scaled, and one more difference that moves all sizes alike."""
    columns = np.column_stack((series.from_unit, np.full(len(series), free)))
    return replace(series, own=scale * series.own, from_unit=columns)


def falls(series: SizeSeries) -> list[int]:
    """Recordings before which the size has fallen by more than recordings scatter."""
    apart = np.hypot(series.own[1:], series.own[:-1])
    return (1 + np.flatnonzero(np.diff(series.sizes) < -FALLS_BY * apart)).tolist()
