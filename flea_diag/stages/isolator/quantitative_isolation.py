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

"""Quantitative isolation: fault models of this stand and the baseline of its unit."""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping

import numpy as np
import numpy.typing as npt

from flea_diag.core.calibration.calibration import Calibration
from flea_diag.core.isolation.unseen_growth import UnseenGrowth
from flea_diag.core.isolation.weights import Weights
from flea_diag.core.likelihood.basis import signals_of
from flea_diag.core.likelihood.effect_set import EffectSet, name_of
from flea_diag.core.likelihood.effects import ELAPSED
from flea_diag.core.likelihood.estimation import fitted
from flea_diag.core.likelihood.evidence_sums import EvidenceSums
from flea_diag.core.likelihood.fault_models import FaultModel
from flea_diag.core.likelihood.fit import Fit
from flea_diag.core.likelihood.sensor_models import expected
from flea_diag.core.likelihood.unit_baseline import UnitBaseline
from flea_diag.core.likelihood.weighing import Weighing, weighing_of
from flea_diag.core.residuals.thermal import CORRECTION_S
from flea_diag.core.symbolic.expression import ONE
from flea_diag.stages.isolator.fault_episode import FaultEpisode
from flea_diag.wire.blocks import ResidualBlock, block_of
from flea_diag.wire.records import Residual

Array = npt.NDArray[np.float64]


class QuantitativeIsolation:
    """Models of the faults on this stand, and the baseline of its unit.

    Attributes
    ----------
    names
        Residuals of this stand that the models explain.
    basis
        Signals that the models are made of.
    models
        Models of the faults that move one of them; other faults have no likelihood here.
    weights
        What each residual weighs.
    acting
        Which signals they act by in each residual, shape (residuals, signals), without those that
        this stand does not read.
    """

    def __init__(self, calibration: Calibration, effects: EffectSet) -> None:
        self._counts = calibration.counts
        fitted = calibration.parameters
        residuals = effects.residuals
        self._friction, self._in_motion = residuals.friction, residuals.in_motion
        # Not the relation with friction: a drag already present at start would be learned.
        self._baseline_residuals: tuple[str, ...] = (residuals.circuit,)
        # Where that relation left its earlier level, the drag began within the run.
        self._before_shift = residuals.circuit, residuals.friction
        # With an error of a reading no other unit has come, nor has a drag been there before.
        units = {effect.residual for _, effect in effects.units}.difference(residuals.predictions)
        self._before_error = tuple(units.union(self._before_shift))
        self.weights = Weights.of(calibration, effects)
        self.names = tuple(name for name in residuals.weighed if name in self.weights.sigma)
        self.basis = effects.basis_of(fitted)
        unseen = UnseenGrowth(
            _limits_of_means(calibration, residuals.of_unit), name_of(ELAPSED), name_of(ONE)
        )
        self.models = tuple(map(unseen.bound, self._of_stand(effects.bound(fitted))))
        self.acting = signals_of(self.models, self.names, self.basis)
        self.acting[:, [self.basis.column[name] for name in effects.lacking]] = False
        self._go_on_without(residuals.predictions)
        self._of_vibration = self._of_stand(effects.bound(fitted, is_vibration_only=True))
        self._baseline = UnitBaseline(self.names, self.basis, self._counts)
        self._waiting: list[Residual] = []

    def _of_stand(self, models: tuple[FaultModel, ...]) -> tuple[FaultModel, ...]:
        """Models that move one of the residuals of this stand."""
        return tuple(m for m in models if any(term.residual in self.names for term in m.terms))

    def _go_on_without(self, predictions: Mapping[str, str]) -> None:
        """A prediction without the reading of a neighbour takes it for none: it errs by nothing."""
        for row, name in enumerate(self.names):
            if name in predictions:
                others = {expected(c).name for n, c in predictions.items() if n != name}
                places = [self.basis.column[each] for each in others & self.basis.column.keys()]
                self.acting[row, places] = False

    def interrupt_baseline(self) -> None:
        """An episode begins: scans from now on are not part of the baseline."""
        self._waiting.clear()
        self._baseline.interrupt()

    def forget(self) -> None:
        """The unit was exchanged: the baseline of the previous one does not apply."""
        self._waiting.clear()
        self._baseline = UnitBaseline(self.names, self.basis, self._counts)

    def learn_scan(self, record: Residual) -> None:
        """``learn`` for one scan; kept scans are buffered until their piece is over."""
        if self._waiting and record.names != self._waiting[0].names:
            self._keep()
        if self._baseline.count():
            self._waiting.append(record)
        if self._baseline.is_piece_over:
            self._keep()

    def _keep(self) -> None:
        """Add the buffered scans."""
        if self._waiting:
            self._baseline.keep(*self._of_baseline(block_of(*self._waiting)))
            self._waiting.clear()

    def learn(self, block: ResidualBlock) -> None:
        """Learn the baseline from scans without a deviation."""
        self._keep()
        self._baseline.add(*self._of_baseline(block))

    def _of_baseline(self, block: ResidualBlock) -> tuple[Array, Array]:
        """Residuals of the baseline, NaN where they do not count; regressors."""
        values = np.full((len(block), len(self.names)), np.nan)
        resting = block.regressors[:, -1] <= 0.5
        for column, name in enumerate(self.names):
            if name in self._before_error and name in block.names:
                values[:, column] = block.values[:, block.names.index(name)]
                if name in self._in_motion:
                    values[resting, column] = np.nan
        return values, block.regressors[:, : len(self.basis.names)]

    def fits(self, episode: FaultEpisode) -> tuple[Fit, ...]:
        """Fits of the remaining faults to the evidence of an episode; none without evidence."""
        alive = set(episode.names())
        vibration_only = episode.is_vibration_only
        known = self._of_vibration if vibration_only else self.models
        models = [model for model in known if model.fault in alive]
        if not (models and (episode.symbols or vibration_only) and episode.evidence.scans):
            return ()
        sums = episode.evidence.equations.now
        if not self._holds_what_deviates(episode, sums):
            return ()
        return fitted(sums, models, self.weighing(episode, sums))

    def _holds_what_deviates(self, episode: FaultEpisode, sums: EvidenceSums) -> bool:
        """Whether some relation that deviates is in the evidence: others say nothing of it."""
        seen = episode.relations_seen & set(self.names)
        return not seen or any(sums.samples[self.names.index(name)] > 0.0 for name in seen)

    def weighing(
        self,
        episode: FaultEpisode,
        sums: EvidenceSums,
        is_same_unit: bool = True,
        is_of_reading: bool = False,
    ) -> Weighing:
        """What evidence of an episode weighs; else it may be of another unit than before.

        The mechanical baseline is used only where it was learned without the fault: a shift of the
        mechanical relation opened the episode, vibration deviates and no relation does, or what is
        looked for is a second fault beside an error ``is_of_reading``.
        """
        shared = episode.shared
        baseline = self._baseline.evidence if is_same_unit else None
        mechanical_shift = (
            bool(shared.opening_shift)
            and episode.residuals.relation(shared.opening_shift) == self._friction
            and not shared.opened_by_vibration
        )
        known = self._baseline_residuals
        if is_of_reading:
            known = self._before_error
        elif mechanical_shift or episode.is_vibration_only:
            known = self._before_shift
        own = baseline is not None and known is not self._baseline_residuals
        return weighing_of(
            sums,
            self.weights.own_sigma if own else self.weights.sigma,
            self.weights.correlation,
            self.weights.tolerances,
            None if baseline is None else baseline.sums,
            known,
        )


def _limits_of_means(
    calibration: Calibration, predictions: Collection[str]
) -> dict[str, list[tuple[float, float]]]:
    """Windows (s) of these residuals, and what a mean over each is detected by at most."""
    unit = calibration.tolerance.thermal_rate_k_per_s * CORRECTION_S
    return {
        limit.name: [
            (row.window * calibration.period_s, row.k * math.hypot(max(row.sigma), unit))
            for row in limit.windows
        ]
        for limit in calibration.limits
        if limit.name in predictions
    }
