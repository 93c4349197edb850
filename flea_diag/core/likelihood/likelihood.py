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

"""Likelihood of the hypotheses that qualitative isolation leaves, with sizes and errors.

Residuals y of the window are explained as y = Phi theta + Psi eta + noise: theta the sizes of
one fault (bounded), eta what another healthy unit of the design may differ by (Gaussian,
``UnitTolerance``), noise coloured with so many samples to one independent one. Everything is
kept as normal equations (sums over samples), so a hypothesis costs a small solve, however
long the episode:

    J_h = min_theta,eta  sum (y - Phi theta - Psi eta)^2 / (c sigma^2) + eta' Lambda eta
    log L_h = (J_0 - J_h) / 2 - dim(theta) ln(n) / 2          (BIC; J_0 without a fault)

Only sizes that are not 0 count as dimensions, and as n the independent samples of the residuals
that any of the faults moves.

After Biswas et al. and Willsky and Jones: parameter estimation takes over where signs do not
help any further.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence

import numpy as np
import numpy.typing as npt

from flea_diag.core.likelihood.basis import Basis, effect_of
from flea_diag.core.likelihood.estimation import fitted
from flea_diag.core.likelihood.evidence_sums import EvidenceSums
from flea_diag.core.likelihood.fault_models import FaultModel
from flea_diag.core.likelihood.fit import Fit
from flea_diag.core.likelihood.weighing import weighing_of

Array = npt.NDArray[np.float64]

FOLD = 50
"""Samples that are summed at once: always the same ones, so that sums have the same last bits."""


class NormalEquations:
    """Normal equations of every residual over an episode, in the signals of ``basis``.

    Constant memory.
    """

    def __init__(self, residuals: Sequence[str], basis: Basis, block_scans: int = FOLD) -> None:
        self.residuals, self.basis = tuple(residuals), basis
        self._least_block = max(block_scans, FOLD)
        count, width = len(self.residuals), len(basis.names)
        self.sums = EvidenceSums.none(self.residuals, basis)
        """Without the samples that still wait for ``FOLD``. Blocks are ``block_scans`` or ``FOLD``
        long, and count for a residual that has at least half of their values."""
        self._block, self._block_samples = np.zeros((count, 1 + width)), np.zeros(count)
        self._block_scans = 0
        self._values, self._phi = np.empty((FOLD, count)), np.empty((FOLD, width))
        self._waiting = 0

    def add(self, values: Array, regressors: Array) -> None:
        """N samples: residuals, shape (n, residuals), NaN = none, and basis signals."""
        for start in range(0, len(values), FOLD):
            part = slice(start, start + FOLD)
            self._wait(values[part], regressors[part])

    def _wait(self, values: Array, regressors: Array) -> None:
        """Buffer samples until ``FOLD`` are there: the sums do not depend on block sizes."""
        room = FOLD - self._waiting
        for some, more in ((values[:room], regressors[:room]), (values[room:], regressors[room:])):
            rows = slice(self._waiting, self._waiting + len(some))
            self._values[rows], self._phi[rows] = some, more
            self._waiting += len(some)
            if self._waiting == FOLD:
                self._fold()

    def _fold(self) -> None:
        """Add the buffered samples to the sums."""
        if not self._waiting:
            return
        values, phi = self._values[: self._waiting], self._phi[: self._waiting]
        phi = np.where(np.isnan(phi), 0.0, phi)  # in a quarter of the time of ``nan_to_num``
        sums = self.sums
        shared: dict[bytes, tuple[Array, Array, Array]] = {}
        every = np.isfinite(values).T
        for index in np.flatnonzero(every.any(axis=1)).tolist():
            known = every[index]
            # Residuals that have a value in the same scans share what the signals add.
            key = known.tobytes()
            if key not in shared:
                own = phi[known]
                shared[key] = own, own.T @ own, own.sum(axis=0)
            signals, gram, total = shared[key]
            y = values[known, index]
            sums.gram[index] += gram
            sums.cross[index] += y @ signals
            sums.square[index] += y @ y
            sums.samples[index] += len(y)
            self._block[index, 0] += y.sum()
            self._block[index, 1:] += total
            self._block_samples[index] += len(y)
        self._block_scans += self._waiting
        self._waiting = 0
        if self._block_scans >= self._least_block:
            self._end_block()

    def _end_block(self) -> None:
        """Add the products of the means of this block."""
        enough = 2 * self._block_samples >= self._block_scans
        mean = self._block[enough] / self._block_samples[enough, None]
        self.sums.means[enough] += mean[:, :, None] * mean[:, None, :]
        self.sums.blocks[enough] += 1.0
        self._block[:], self._block_samples[:], self._block_scans = 0.0, 0.0, 0

    def fade(self, share: float) -> None:
        """Scale all sums by ``share``."""
        self._fold()
        self.sums.scale(share)

    def take(self, other: NormalEquations, times: float) -> None:
        """Add other evidence, each of its samples counted ``times``."""
        other._fold()
        self.sums.add(other.sums, times)

    @property
    def samples(self) -> Array:
        """Samples of each residual, shape (residuals,)."""
        return self.sums.samples

    @property
    def now(self) -> EvidenceSums:
        """All sums so far."""
        self._fold()
        return self.sums

    def foreseen(self, phi: Array, model: FaultModel, sizes: Sequence[float]) -> NormalEquations:
        """Expected evidence after a planned window in which ``model`` is present.

        Without noise: ``phi`` are the window's regressors, shape (samples, regressors); residuals
        without a sample so far have none then either.
        """
        self._fold()
        after, sums = NormalEquations(self.residuals, self.basis), self.sums
        known = np.nan_to_num(phi)
        gram = known.T @ known
        for index, name in enumerate(self.residuals):
            here = float(sums.samples[index] > 0)
            effect = effect_of(model, name, sizes, self.basis)
            after.sums.gram[index] = sums.gram[index] + here * gram
            after.sums.cross[index] = sums.cross[index] + here * (gram @ effect)
            after.sums.square[index] = sums.square[index] + here * float(effect @ gram @ effect)
            after.sums.samples[index] = sums.samples[index] + here * len(phi)
        return after

    def showing(self, model: FaultModel, sizes: Sequence[float]) -> NormalEquations:
        """The same evidence, had ``model`` been present in these sizes throughout."""
        self._fold()
        faulty, sums = NormalEquations(self.residuals, self.basis), self.sums
        faulty.take(self, 1.0)
        for index, name in enumerate(self.residuals):
            effect = effect_of(model, name, sizes, self.basis)
            added = sums.gram[index] @ effect
            faulty.sums.cross[index] += added
            faulty.sums.square[index] += 2.0 * float(effect @ sums.cross[index]) + effect @ added
        return faulty

    def fit(
        self,
        models: Sequence[FaultModel],
        sigma: Mapping[str, float],
        correlation: Mapping[str, float],
        tolerance: Sequence[float],
        baseline: NormalEquations | None = None,
        baseline_residuals: Collection[str] = (),
    ) -> tuple[Fit, ...]:
        """Fits of all ``models``, in their order.

        ``sigma`` is the nominal scatter of each residual and ``correlation`` the samples to
        one independent sample; ``tolerance`` is in the order of the basis's differences. The
        unit's ``baseline``, in the residuals ``baseline_residuals``, narrows that tolerance.
        """
        self._fold()
        known = None if baseline is None else baseline.sums
        weighing = weighing_of(self.sums, sigma, correlation, tolerance, known, baseline_residuals)
        return fitted(self.sums, models, weighing)
