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

"""What a squared residual weighs in a fit, and what is known of the unit before it."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from flea_diag.core.likelihood.evidence_sums import EvidenceSums
from flea_diag.core.residuals.unit_difference import Unit

Array = npt.NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Weighing:
    """Weights of one fit.

    Attributes
    ----------
    spacing
        Samples of each residual to one independent sample, shape (residuals,).
    weight
        Of a squared residual, shape (residuals,).
    unit
        What is known of the unit.
    tolerance
        What healthy units differ by, one sigma each.
    """

    spacing: Array
    weight: Array
    unit: Unit
    tolerance: Array

    def log_independent(self, sums: EvidenceSums) -> float:
        """Logarithm of the independent samples of all residuals."""
        return float(np.log(max(float((sums.samples / self.spacing).sum()), 2.0)))


def weighing_of(
    sums: EvidenceSums,
    sigma: Mapping[str, float],
    correlation: Mapping[str, float],
    tolerance: Sequence[float],
    baseline: EvidenceSums | None,
    baseline_residuals: Collection[str],
) -> Weighing:
    """By the noise of the residuals and the baseline of the unit; as of ``NormalEquations.fit``."""
    spacing = np.array([correlation[name] for name in sums.residuals])
    weight = 1.0 / (spacing * np.square([sigma[name] for name in sums.residuals]))
    unit = Unit.of(tolerance)
    if baseline is not None:
        known = weight * [name in baseline_residuals for name in sums.residuals]
        shown = baseline.stack((None,)).systems(known, Unit.unknown(len(tolerance)))
        unit = unit.shown(shown.A[0], shown.b[0])
    return Weighing(spacing, weight, unit, np.asarray(tolerance, dtype=float))
