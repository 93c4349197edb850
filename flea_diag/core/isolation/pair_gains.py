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

"""Gains of pairs of faults: what each two of them would explain together, all pairs at once.

Two faults add up in the relations, so the normal equations of a pair are blocks of one system that
holds the columns of all. What a healthy unit may differ by is projected out of it once; of each
pair a system of two to six unknowns is left, and all of these are solved side by side within the
bounds of their sizes. That ranks the pairs; ``estimation`` fits the best of them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from flea_diag.core.isolation.pair_models import together
from flea_diag.core.likelihood.basis import designs_made
from flea_diag.core.likelihood.bounded_systems import scaled
from flea_diag.core.likelihood.evidence_sums import EvidenceSums
from flea_diag.core.likelihood.fault_models import FaultModel
from flea_diag.core.likelihood.weighing import Weighing

Array = npt.NDArray[np.float64]

SWEEPS = 12
"""Sweeps of the bounded solution, which starts from the unbounded one: more change no ranking."""
RIDGE = 1e-9
"""Share of each diagonal that is added to it: two faults may act alike."""


@dataclass(frozen=True, slots=True)
class PairGain:
    """Two models, by number, and the nats by which they explain more than no fault does."""

    one: int
    other: int
    nats: float


def pair_gains(
    sums: EvidenceSums,
    models: Sequence[FaultModel],
    pairs: Sequence[tuple[int, int]],
    weighing: Weighing,
) -> list[PairGain]:
    """Gains of these pairs of models, less the price of their sizes, the largest first."""
    system = _joint(sums, models, weighing)
    found: list[PairGain] = []
    alike: dict[tuple[int, int], list[tuple[int, int]]] = {}
    for one, other in pairs:
        counts = len(models[one].sizes), len(models[other].sizes)
        alike.setdefault(counts, []).append((one, other))
    price = 0.5 * weighing.log_independent(sums)
    for counts, group in alike.items():
        gains = system.gains(group) - price * sum(counts)
        found += [PairGain(*pair, nats) for pair, nats in zip(group, gains.tolist(), strict=True)]
    return sorted(found, key=lambda row: -row.nats)


@dataclass(frozen=True, eq=False)
class _Joint:
    """Columns of all models, scaled to a unit diagonal, without what a unit may differ by.

    ``starts`` is the first column of each model, ``low`` and ``high`` are the bounds of all.
    """

    A: Array
    b: Array
    low: Array
    high: Array
    starts: Sequence[int]
    counts: Sequence[int]

    def gains(self, pairs: Sequence[tuple[int, int]]) -> Array:
        """Gains of pairs of equal numbers of sizes, shape (pairs,)."""
        places = np.array([(*self._columns(one), *self._columns(other)) for one, other in pairs])
        A, b = self.A[places[:, :, None], places[:, None, :]], self.b[places]
        low, high = self.low[places], self.high[places]
        A = A + RIDGE * np.eye(places.shape[1])
        x = np.clip(np.linalg.solve(A, b[..., None])[..., 0], low, high)
        for _ in range(SWEEPS):
            for k in range(x.shape[1]):
                left = b[:, k] - (A[:, k] * x).sum(axis=1) + A[:, k, k] * x[:, k]
                x[:, k] = np.clip(left / A[:, k, k], low[:, k], high[:, k])
        quadratic = (x * np.matmul(A, x[..., None])[..., 0]).sum(axis=1)
        return np.asarray((x * b).sum(axis=1) - 0.5 * quadratic)

    def _columns(self, model: int) -> range:
        return range(self.starts[model], self.starts[model] + self.counts[model])


def _joint(sums: EvidenceSums, models: Sequence[FaultModel], weighing: Weighing) -> _Joint:
    """The system of all models."""
    counts = [len(model.sizes) for model in models]
    starts = np.concatenate(([0], np.cumsum(counts)))
    design = designs_made((together(*models),), sums.residuals, sums.basis).every[0]
    weighed = design.transpose(0, 2, 1) * weighing.weight[:, None, None]
    A = np.add.reduce(np.matmul(weighed, np.matmul(sums.gram, design)), axis=0)
    b = np.add.reduce(np.matmul(weighed, sums.cross[..., None])[..., 0], axis=0)
    size = int(starts[-1])
    A[size:, size:] += weighing.unit.information
    b[size:] += weighing.unit.vector
    A, scale = scaled(A)
    b = b / scale
    removed = np.linalg.solve(A[size:, size:], np.column_stack((A[size:, :size], b[size:])))
    A, b = (
        A[:size, :size] - A[:size, size:] @ removed[:, :-1],
        b[:size] - A[:size, size:] @ removed[:, -1],
    )
    # What the unit explains as well is left with next to nothing.
    A[np.diag_indices(size)] = np.maximum(A.diagonal(), RIDGE)
    bounds = (
        np.array([(s.low, s.high) for model in models for s in model.sizes]) * scale[:size, None]
    )
    return _Joint(A, b, bounds[:, 0], bounds[:, 1], starts[:-1].tolist(), counts)
