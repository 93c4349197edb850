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

"""Estimation: what sizes each fault model has in an episode, and how likely it is with them.

From sums alone (``evidence_sums``), all models side by side. Scatter that no model explains lowers
the weight of its residual, scatter of a fault's own effect that of what it moves.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from flea_diag.core.likelihood.basis import effect_of
from flea_diag.core.likelihood.bounded_systems import BoundedSystems
from flea_diag.core.likelihood.evidence_sums import EvidenceSums
from flea_diag.core.likelihood.fault_models import FaultModel, moved_by
from flea_diag.core.likelihood.fit import Fit, Solution
from flea_diag.core.likelihood.model_stack import ModelStack
from flea_diag.core.likelihood.weighing import Weighing
from flea_diag.core.residuals.unit_difference import Unit

Array = npt.NDArray[np.float64]


def fitted(
    sums: EvidenceSums, models: Sequence[FaultModel], known: Weighing, once: bool = False
) -> tuple[Fit, ...]:
    """Fits of all ``models``, in their order; ``once``: of models that are soon forgotten."""
    spacing, weight, unit = known.spacing, known.weight, known.unit
    stack = sums.stack((*models, None), once)
    systems = stack.systems(weight, unit)
    dispersion = _dispersion(sums, spacing, stack, systems, weight)
    if (dispersion != 1.0).any():
        weight = weight / dispersion
        systems = stack.systems(weight, unit)
    moved = moved_by(models)
    counts = sums.samples / spacing * [name in moved for name in sums.residuals]
    log_independent = float(np.log(max(float(counts.sum()), 2.0)))
    nominal = systems.misfit(len(models), float(weight @ sums.square))
    means = sums.means.copy()  # as they are now: a fit is asked for details later
    fitting = _Fitting(
        sums, spacing, weight, unit, nominal, log_independent, means, known.tolerance
    )
    found = dict(fitting.fits(stack, systems))
    return tuple(found[model] for model in models)


def _dispersion(
    sums: EvidenceSums,
    spacing: Array,
    stack: ModelStack,
    systems: BoundedSystems,
    weight: Array,
) -> Array:
    """Excess scatter of each residual over noise, under the model that fits it best.

    Where even that leaves a misfit of phi > 1 for each independent sample, the variance of
    this residual is scaled by phi (quasi-likelihood); other residuals are not affected.
    """
    misfits = sums.misfits(stack, systems.solutions, weight)
    least = np.minimum.reduce(misfits[: len(stack.faults)], axis=0, initial=np.inf)
    independent = np.maximum(sums.samples / spacing, 1.0)
    return np.maximum(1.0, np.where(np.isfinite(least), least, 0.0) / independent)


@dataclass(frozen=True, eq=False)
class _Fitting:
    """What the fits of all models share.

    Attributes
    ----------
    sums
        Evidence.
    spacing
        Samples of each residual to one independent sample.
    weight
        Of a squared residual.
    unit
        What is known of the unit.
    nominal
        Misfit without a fault.
    log_independent
        Logarithm of the independent samples of all residuals that any of the faults moves.
    means
        Products of block means, as they are now.
    tolerance
        What healthy units differ by, one sigma each.
    """

    sums: EvidenceSums
    spacing: Array
    weight: Array
    unit: Unit
    nominal: float
    log_independent: float
    means: Array
    tolerance: Array

    def fits(self, stack: ModelStack, systems: BoundedSystems) -> Iterator[tuple[FaultModel, Fit]]:
        """Fits of all models of a stack, in any order."""
        square, means = float(self.weight @ self.sums.square), self.means
        faults = stack.faults
        rough = [k for k, model in enumerate(faults) if model.roughness > 0.0]
        for k, model in enumerate(faults):
            if model.roughness == 0.0:
                gain = 0.5 * (self.nominal - systems.misfit(k, square))
                solution = Solution(systems, k, stack.design(k), means, self.weight, self.tolerance)
                yield model, self._fit(model, gain, solution)
        if not rough:
            return
        weights, losses = zip(
            *(self._roughened(faults[k], systems.sizes(k)) for k in rough), strict=True
        )
        systems = stack.systems(np.stack(weights), self.unit, rough)
        for place, k in enumerate(rough):
            misfit = systems.misfit(place, float(weights[place] @ self.sums.square))
            gain = 0.5 * (self.nominal - misfit) - losses[place]
            solution = Solution(
                systems, place, stack.design(k), means, weights[place], self.tolerance
            )
            yield faults[k], self._fit(faults[k], gain, solution)

    def _roughened(self, model: FaultModel, sizes: Sequence[float]) -> tuple[Array, float]:
        """Weights with the scatter of the fault's own effect added, and what that costs.

        The variance of each residual that the fault moves grows by (roughness * effect)^2; the
        Gaussian's normalisation then costs ln(growth) / 2 for each independent sample.
        """
        sums, weight, spacing = self.sums, self.weight, self.spacing
        rough, loss = weight.copy(), 0.0
        moved = moved_by([model])
        for index, name in enumerate(sums.residuals):
            if name not in moved or not sums.samples[index]:
                continue
            effect = effect_of(model, name, sizes, sums.basis)
            if effect.any():
                square = float(effect @ sums.gram[index] @ effect) / sums.samples[index]
                # weight = 1 / (c sigma^2): growth is 1 + roughness^2 square / sigma^2.
                growth = 1.0 + model.roughness**2 * square * weight[index] * spacing[index]
                rough[index] /= growth
                loss += 0.5 * sums.samples[index] / spacing[index] * np.log(growth)
        return rough, loss

    def _fit(self, model: FaultModel, gain: float, solution: Solution) -> Fit:
        """Likelihood by BIC: half a logarithm of the sample count for each size that is not 0.

        A size at a bound counts as fitted: otherwise the largest spall would be the simpler
        explanation of a weak jam, and the weakest jam that of lost lubrication.
        """
        sizes = solution.systems.sizes(solution.number)
        penalty = 0.5 * sum(map(bool, sizes)) * self.log_independent
        return Fit(model.fault, float(gain - penalty), sizes, solution)
