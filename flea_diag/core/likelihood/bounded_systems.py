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

"""Small systems of normal equations side by side, solved with some unknowns held to bounds.

Each has the bits that it would have alone: what numpy does to a stack, it does matrix by matrix.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt

from flea_diag.core.likelihood.fault_models import FaultModel, Size

Array = npt.NDArray[np.float64]

RANK = 1e-12
"""Eigenvalues below this share of the largest one count as zero."""


@dataclass(frozen=True, eq=False)
class BoundedSystems:
    """Minimise x' A x - 2 b' x for each of m models: A, shape (d, n, n), and b, shape (d, n).

    ``models`` are the faults whose sizes come first among the unknowns, and ``places`` says which
    system is theirs: several may share one and differ in their bounds. There are ``count`` sizes
    among the unknowns; of one that a model lacks nothing is known, and it is 0.
    """

    models: Sequence[FaultModel | None]
    places: Sequence[int]
    A: Array
    b: Array
    count: int

    @cached_property
    def _scaled(self) -> tuple[Array, Array]:
        return scaled(self.A)

    @cached_property
    def solutions(self) -> Array:
        """Solutions with the sizes held to their bounds, one after the other, shape (m, n)."""
        A, scale = self._scaled
        free = _least(A, self.b / scale) / scale
        x: Array = free[list(self.places)]
        held: dict[tuple[object, ...], Array] = {}
        for k, values in enumerate(x[:, : self.count].tolist()):
            sizes, own = _sizes(self.models[k]), self.places[k]
            outside = _outside(sizes, values)
            if outside is None:
                continue
            # Models that differ in their roughness alone share their bounds.
            key = own, *((size.low, size.high) for size in sizes)
            if key not in held:
                held[key] = self._held(own, sizes, x[k], outside)
            x[k] = held[key]
        return x

    def _held(
        self, own: int, sizes: Sequence[Size], x: Array, outside: tuple[int, float] | None
    ) -> Array:
        """``x`` with sizes held to their bounds, beginning with the one that is ``outside``."""
        A, b, (scaled_A, scale) = self.A[own], self.b[own], self._scaled
        x, free = x.copy(), np.ones(len(b), dtype=bool)
        for _ in sizes:
            if outside is None:
                break
            index, bound = outside
            free[index], x[index] = False, bound
            rows = free.nonzero()[0]
            by = scale[own, rows]
            left = (b - A @ np.where(free, 0.0, x))[rows] / by
            x[rows] = _least(scaled_A[own][rows[:, None], rows], left) / by
            outside = _outside(sizes, x[: len(sizes)].tolist(), free)
        return x

    def errors(self, which: Sequence[int]) -> Array:
        """Standard errors of the sizes of these models, shape (len(which), count)."""
        if not self.count or not len(which):
            return np.empty((len(which), self.count))
        needed, places = np.unique([self.places[k] for k in which], return_inverse=True)
        A, scale = (of[needed] for of in self._scaled)
        variances = np.diagonal(np.linalg.pinv(A), axis1=-2, axis2=-1)
        errors = np.sqrt(np.clip(variances, 0.0, None)) / scale
        return np.asarray(errors[places, : self.count])

    def inverse(self, which: int) -> Array:
        """Covariance of all unknowns of one model, shape (n, n), with no size held to a bound."""
        A, scale = (of[self.places[which]] for of in self._scaled)
        return np.asarray(np.linalg.pinv(A) / scale[:, None] / scale)

    @cached_property
    def _found(self) -> list[list[float]]:
        found: list[list[float]] = self.solutions[:, : self.count].tolist()
        return found

    def sizes(self, k: int) -> tuple[float, ...]:
        """Sizes of one model."""
        return tuple(self._found[k][: len(_sizes(self.models[k]))])

    def misfit(self, k: int, square: float) -> float:
        """Smallest sum of squares of one model; ``square`` is that without unknowns."""
        own = self.places[k]
        x, A, b = self.solutions[k], self.A[own], self.b[own]
        return float(square - 2.0 * b @ x + x @ A @ x)


def scaled(A: Array) -> tuple[Array, Array]:
    """Normal equations scaled to a unit diagonal, and the scale of each unknown.

    In SI units a viscous drag would fall below the rank tolerance beside the rate of a temperature.
    """
    scale = np.sqrt(A.diagonal(0, -2, -1))
    scale[scale == 0.0] = 1.0
    return A / scale[..., None, :] / scale[..., :, None], scale


def _sizes(model: FaultModel | None) -> tuple[Size, ...]:
    return () if model is None else model.sizes


def _least(A: Array, b: Array) -> Array:
    """The shortest of the least-squares solutions, shape (..., n)."""
    values, vectors = np.linalg.eigh(A)
    shown = values > RANK * values[..., -1:]
    along = np.matmul(b[..., None, :], vectors)[..., 0, :]
    told = np.divide(along, values, out=np.zeros_like(along), where=shown)
    return np.asarray(np.matmul(vectors, told[..., None])[..., 0], dtype=float)


def _outside(
    sizes: Sequence[Size], x: Sequence[float], free: npt.NDArray[np.bool_] | None = None
) -> tuple[int, float] | None:
    """The first free size outside its bounds, and the bound at which to hold it."""
    for index, size in enumerate(sizes):
        value = x[index]
        if not size.low <= value <= size.high and (free is None or free[index]):
            return index, size.low if value < size.low else min(value, size.high)
    return None
