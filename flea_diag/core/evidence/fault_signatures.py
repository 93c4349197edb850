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

"""Signatures of all fault models in the windows of a stand, and the prior of their sizes.

A size is uniform a priori between its bounds, taken as a normal distribution of the same mean and
variance that is cut there. How far a size without a bound reaches is given.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
import numpy.typing as npt

from flea_diag.core.likelihood.basis import Basis
from flea_diag.core.likelihood.effects import ELAPSED
from flea_diag.core.likelihood.fault_models import FaultModel

Array = npt.NDArray[np.float64]

ONE = "one"


@dataclass(frozen=True, eq=False)
class SizePrior:
    """Mean, standard deviation and bounds of every size, shape (models, sizes)."""

    mean: Array
    sigma: Array
    low: Array
    high: Array

    def of(self, models: npt.NDArray[np.intp]) -> SizePrior:
        """The same of these models alone."""
        return SizePrior(*(each[models] for each in (self.mean, self.sigma, self.low, self.high)))


@dataclass(frozen=True, eq=False)
class FaultSignatures:
    """Models of equal numbers of sizes: what a model lacks has no effect.

    ``design``, shape (residuals, signals, models * sizes), is what one unit of each size adds to
    each residual, as factors of the basis signals; ``reach`` is that of sizes without a bound.
    ``turns`` are places among ``models * sizes``, one of each model by which the error of a reading
    may turn its sign: no size of the fault, but how much of what the sign does is turned, 0 to 1.
    """

    models: tuple[FaultModel, ...]
    design: Array
    elapsed: int
    reach: Array
    turns: npt.NDArray[np.intp] = field(default_factory=lambda: np.empty(0, dtype=np.intp))

    @classmethod
    def of(
        cls, models: Sequence[FaultModel], residuals: Sequence[str], basis: Basis,
        signed: str = "",
    ) -> FaultSignatures:  # fmt: skip
        """Signatures in these residuals; ages of a drift and rough variants are left out.

        The bank of onsets has ages of its own, and coloured noise is in the noise. ``signed`` is
        the channel whose sign is a signal as well; empty: none is.
        """
        seen: dict[object, FaultModel] = {}
        for model in models:
            terms = tuple(term for term in model.terms if term.residual in residuals)
            if terms and not model.roughness:
                grown = tuple(term for term in terms if term.regressor != ONE)
                seen.setdefault((model.fault, grown or terms), replace(model, terms=terms))
        kept = tuple(seen.values())
        turned = [bool(signed) and model.channel == signed for model in kept]
        sizes = max(len(model.sizes) + more for model, more in zip(kept, turned, strict=True))
        design = np.zeros((len(residuals), len(basis.names), len(kept), sizes))
        rows = {name: row for row, name in enumerate(residuals)}
        for column, model in enumerate(kept):
            for term in model.terms:
                place = rows[term.residual], basis.column[term.regressor], column, term.index
                design[place] += term.gain
        elapsed = basis.column[str(ELAPSED)]
        flat = design.reshape(*design.shape[:2], -1)
        turns = [k * sizes + len(kept[k].sizes) for k in np.flatnonzero(turned)]
        reach = np.full((len(kept), sizes), np.inf)
        return cls(kept, flat, elapsed, reach, np.array(turns, dtype=np.intp))

    @property
    def shape(self) -> tuple[int, int]:
        """Models and sizes."""
        return self.reach.shape[0], self.reach.shape[1]

    def signals(self, regressors: Array) -> tuple[Array, Array]:
        """What one unit of each size adds to each residual, shape (..., residuals, models * sizes).

        The second is what it adds for each second since the onset. ``regressors`` has shape
        (..., residuals, signals).
        """
        added = np.matmul(regressors[..., None, :], self.design)[..., 0, :]
        return added, self.design[:, self.elapsed]

    @cached_property
    def prior(self) -> SizePrior:
        """Of each size; one that a model lacks has no bounds."""
        rows = np.zeros((4, *self.shape))
        rows[1], rows[2], rows[3] = 1.0, -np.inf, np.inf
        for k, model in enumerate(self.models):
            for i, size in enumerate(model.sizes):
                rows[:, k, i] = _prior(size.low, size.high, float(self.reach[k, i]))
        rows.reshape(4, -1)[:, self.turns] = np.array(_prior(0.0, 1.0, 1.0))[:, None]
        return SizePrior(*rows)


def _prior(low: float, high: float, reach: float) -> tuple[float, float, float, float]:
    """Mean, standard deviation and bounds of one size."""
    if math.isinf(low) or math.isinf(high):
        return 0.0, reach, low, high
    if high <= low:
        return low, 0.0, -math.inf, math.inf
    return 0.5 * (low + high), (high - low) / math.sqrt(12.0), low, high
