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

"""Sums over the samples of an episode: all that a fit needs of it, however long it was."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from flea_diag.core.likelihood.basis import Basis, designs_made, designs_of
from flea_diag.core.likelihood.fault_models import FaultModel
from flea_diag.core.likelihood.model_stack import ModelStack

Array = npt.NDArray[np.float64]


@dataclass(eq=False)
class EvidenceSums:
    """Sums of every residual over its samples, which are added in place.

    Attributes
    ----------
    residuals, basis
        What is summed.
    gram
        Products of the basis signals, shape (residuals, signals, signals).
    cross
        Products of residual and signals, shape (residuals, signals).
    square
        Squares, shape (residuals,).
    samples
        Number of samples.
    means
        Products of the means of blocks, shape (residuals, 1 + signals, 1 + signals).
    blocks
        Number of blocks.
    """

    residuals: tuple[str, ...]
    basis: Basis
    gram: Array
    cross: Array
    square: Array
    samples: Array
    means: Array
    blocks: Array

    @property
    def shown(self) -> Array:
        """Of each residual the sum of squares of its block means, shape (residuals,)."""
        return self.means[:, 0, 0]

    @staticmethod
    def none(residuals: tuple[str, ...], basis: Basis) -> EvidenceSums:
        """Sums over no sample."""
        count, width = len(residuals), len(basis.names)
        return EvidenceSums(
            residuals,
            basis,
            np.zeros((count, width, width)),
            np.zeros((count, width)),
            np.zeros(count),
            np.zeros(count),
            np.zeros((count, 1 + width, 1 + width)),
            np.zeros(count),
        )

    @property
    def _all(self) -> tuple[Array, ...]:
        return self.gram, self.cross, self.square, self.samples, self.means, self.blocks

    def scale(self, share: float) -> None:
        """Scale all sums."""
        for sums in self._all:
            sums *= share

    def add(self, other: EvidenceSums, times: float) -> None:
        """Add others, each of their samples counted ``times``."""
        for sums, added in zip(self._all, other._all, strict=True):
            sums += times * added

    def copy(self) -> EvidenceSums:
        """The sums as they are now."""
        return EvidenceSums(self.residuals, self.basis, *(sums.copy() for sums in self._all))

    def since(self, earlier: EvidenceSums) -> EvidenceSums:
        """Sums over the samples that have come since."""
        pairs = zip(self._all, earlier._all, strict=True)
        return EvidenceSums(self.residuals, self.basis, *(now - then for now, then in pairs))

    def stack(self, models: Sequence[FaultModel | None], once: bool = False) -> ModelStack:
        """Models on the sums so far; ``once``: soon forgotten ones."""
        made = designs_made if once else designs_of
        designs = made(tuple(models), self.residuals, self.basis)
        moments = np.matmul(self.gram[designs.entered], designs.own)
        return ModelStack(models, designs, moments, self.cross[designs.entered, :, None])

    def misfits(self, stack: ModelStack, unknowns: Array, weight: Array) -> Array:
        """Misfits at the joint optimum of each model, weighted, shape (models, residuals)."""
        effect = stack.effects(unknowns)
        quadratic = (effect * np.matmul(self.gram, effect[..., None])[..., 0]).sum(axis=-1)
        crossed = (effect * self.cross).sum(axis=-1)
        return np.asarray((self.square - 2.0 * crossed + quadratic) * weight)
