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
Flags = npt.NDArray[np.bool_]

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
        held: dict[tuple[object, ...], _Held] = {}
        using: list[tuple[int, _Held]] = []
        for k, values in enumerate(x[:, : self.count].tolist()):
            sizes, own = _sizes(self.models[k]), self.places[k]
            outside = _outside(sizes, values)
            if outside is None:
                continue
            # Models that differ in their roughness alone share their bounds.
            key = own, *((size.low, size.high) for size in sizes)
            if key not in held:
                held[key] = _Held(own, sizes, x[k].copy(), np.ones(x.shape[1], bool), outside)
            using.append((k, held[key]))
        self._hold(list(held.values()))
        for k, each in using:
            x[k] = each.x
        return x

    def _hold(self, held: list[_Held]) -> None:
        """Hold sizes to their bounds, one of each model at a time, until none is outside."""
        while held := [each for each in held if each.outside is not None]:
            for each in held:
                index, bound = each.outside or (0, 0.0)
                each.free[index], each.x[index] = False, bound
            # As many are free in all, for each round holds one more.
            which = np.array([each.own for each in held])
            free, x = np.array([each.free for each in held]), np.array([each.x for each in held])
            rows = free.nonzero()[1].reshape(len(held), -1)
            model, (scaled_A, scale) = np.arange(len(held))[:, None], self._scaled
            by = scale[which[:, None], rows]
            given = np.matmul(self.A[which], np.where(free, 0.0, x)[..., None])[..., 0]
            left = (self.b[which] - given)[model, rows] / by
            part = scaled_A[which[:, None, None], rows[..., None], rows[:, None]]
            x[model, rows] = _least(part, left) / by
            for each, own in zip(held, x, strict=True):
                each.x = own
                each.outside = _outside(each.sizes, own[: len(each.sizes)].tolist(), each.free)

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
        less, more = self._explained
        return float(square - less[k] + more[k])

    @cached_property
    def _explained(self) -> tuple[list[float], list[float]]:
        """2 b' x and x' A x of each model."""
        x, own = self.solutions, list(self.places)
        row, column = x[:, None], x[..., None]
        every = (
            np.matmul(2.0 * self.b[own][:, None], column),
            np.matmul(np.matmul(row, self.A[own]), column),
        )
        less, more = (each[:, 0, 0].tolist() for each in every)
        return less, more


@dataclass(eq=False)
class _Held:
    """Unknowns of one system while sizes are held to bounds.

    Attributes
    ----------
    own
        Number of the system.
    sizes
        With their bounds.
    x, free
        Unknowns so far, and which of them are not held, both of shape (n,).
    outside
        The first free size outside its bounds, and the bound; None: there is none.
    """

    own: int
    sizes: Sequence[Size]
    x: Array
    free: Flags
    outside: tuple[int, float] | None


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
    sizes: Sequence[Size], x: Sequence[float], free: Flags | None = None
) -> tuple[int, float] | None:
    """The first free size outside its bounds, and the bound at which to hold it."""
    for index, size in enumerate(sizes):
        value = x[index]
        if not size.low <= value <= size.high and (free is None or free[index]):
            return index, size.low if value < size.low else min(value, size.high)
    return None
