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

"""Fault models of equal numbers of sizes, fitted side by side to the same evidence."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from flea_diag.core.likelihood.basis import Designs
from flea_diag.core.likelihood.bounded_systems import BoundedSystems
from flea_diag.core.likelihood.fault_models import FaultModel
from flea_diag.core.residuals.unit_difference import Unit

Array = npt.NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class ModelStack:
    """Designs of m models and the sums of an episode that they meet.

    Attributes
    ----------
    models
        None is the one without a fault.
    designs
        How sizes and unit parameters enter each residual.
    moments
        Gram matrix of each residual that the designs enter by its design, shape of ``designs.own``.
    cross
        Products of these residuals and the signals, shape (entered, signals, 1).
    """

    models: Sequence[FaultModel | None]
    designs: Designs
    moments: Array
    cross: Array

    @property
    def faults(self) -> list[FaultModel]:
        """The models that are of a fault."""
        return [model for model in self.models if model is not None]

    def systems(
        self, weight: Array, unit: Unit, which: Sequence[int] | None = None
    ) -> BoundedSystems:
        """Normal equations of each design with these weights of the residuals.

        Of ``which`` models, where each has weights of its own.
        """
        models, moments = self.models, self.moments
        places, _, entered, own = self.designs
        if which is not None:
            rows, models = [places[k] for k in which], [models[k] for k in which]
            places, own, moments = tuple(range(len(rows))), own[rows], moments[rows]
        weighed = own.transpose(0, 1, 3, 2) * weight[..., entered, None, None]
        A = np.add.reduce(np.matmul(weighed, moments), axis=1)
        b = np.add.reduce(np.matmul(weighed, self.cross)[..., 0], axis=1)
        sizes = b.shape[-1] - len(unit.vector)
        A[:, sizes:, sizes:] += unit.information
        b[:, sizes:] += unit.vector
        return BoundedSystems(models, places, A, b, sizes)

    def design(self, k: int) -> Array:
        """How sizes and unit parameters enter each residual in one model."""
        return np.asarray(self.designs.every[self.designs.places[k]])

    def effects(self, unknowns: Array) -> Array:
        """What these unknowns, shape (m, unknowns), add to each residual, as factors of signals."""
        designs = self.designs.every[list(self.designs.places)]
        return np.asarray(np.matmul(designs, unknowns[:, None, :, None])[..., 0])
