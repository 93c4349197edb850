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

"""What the sensors of a stand can detect and isolate in the motion of its recordings."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import asdict, dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt

from flea_diag.configuration.calibrations import learned
from flea_diag.configuration.description import compiled_relations, described, effects_of
from flea_diag.configuration.stand import Stand
from flea_diag.core.calibration.calibration import Calibration
from flea_diag.core.calibration.run_spread import tolerance_of
from flea_diag.core.choice.planned_motion import completed
from flea_diag.core.isolation.weights import own_sigma
from flea_diag.core.likelihood.effect_set import EffectSet
from flea_diag.core.likelihood.effects import ELAPSED
from flea_diag.core.likelihood.likelihood import NormalEquations
from flea_diag.core.likelihood.sensor_models import expected
from flea_diag.core.likelihood.size_bound import LikelihoodOf, SizeBound, size_bounds
from flea_diag.core.residuals.parameters import ActuatorParameters, actuator_parameters
from flea_diag.core.residuals.parity import channel_of
from flea_diag.core.residuals.relation_set import RelationSet
from flea_diag.core.residuals.residual_bank import ResidualBank
from flea_diag.core.residuals.unit_difference import difference_sigmas
from flea_diag.core.scan_counts import ScanCounts
from flea_diag.core.smoothing import hann_kernels
from flea_diag.core.symbolic.expression import derivative, evaluate
from flea_diag.stages.isolator.parameters import IsolatorParameters
from flea_diag.stages.observer.regressor_table import RegressorTable
from flea_diag.tools.stand_check.motion_signals import MotionSignals, balanced, extended
from flea_diag.tools.stand_check.recorded_motion import RecordedMotion

Array = npt.NDArray[np.float64]
EPISODE_S = 10.0
"""Time that a fault is followed for; recordings count by their mean over so long."""


@dataclass(frozen=True)
class FaultSizes:
    """A stand with the channels of its recordings; without a calibration as it is described."""

    stand: Stand
    channels: tuple[str, ...]
    motions: tuple[RecordedMotion, ...]

    @property
    def period_s(self) -> float:
        """Time between two scans."""
        return self.motions[0].period_s

    @cached_property
    def calibration(self) -> Calibration | None:
        """Of the stand; None where none has been made."""
        return learned(self.stand) if self.stand.calibration.exists() else None

    @cached_property
    def parameters(self) -> ActuatorParameters:
        """As calibrated, or as described."""
        if self.calibration is not None:
            return self.calibration.parameters
        return actuator_parameters(self.relations.described)

    @cached_property
    def relations(self) -> RelationSet:
        """Those that the recorded channels close."""
        return compiled_relations(self.stand.actuator, self.channels, self._has_encoder)

    @property
    def _has_encoder(self) -> bool:
        """Whether an encoder has a lead: without it no relation takes it for the speed."""
        known = self.calibration
        return known is None or known.parameters.encoder_m_per_rad != 0.0

    @cached_property
    def effects(self) -> EffectSet:
        """Effects of the catalogue on them."""
        return effects_of(self.stand.actuator, self.stand.faults, self.relations, self.channels)

    def bounds(self, faults: Collection[str]) -> tuple[SizeBound, ...]:
        """Bounds of these faults in this motion."""
        return self._bounds(self.effects, self.motion, faults)

    def with_sensor(self, channel: str, faults: Collection[str]) -> tuple[SizeBound, ...] | None:
        """The same, were one more channel of the description recorded; None: it follows from none.

        Its reading is what a relation makes of the others.
        """
        channels = (*self.channels, channel)
        relations = compiled_relations(self.stand.actuator, channels, self._has_encoder)
        effects = effects_of(self.stand.actuator, self.stand.faults, relations, channels)
        motion = self.motion
        count = len(motion.regressors)
        constant = {name: np.full(count, x) for name, x in relations.reference.items()}
        # Relations of the sensor may read rates of the others that so far none reads.
        more = {n: x for n, x in self._of_all(effects).signals.items() if np.isfinite(x).any()}
        signals = {**constant, **more, **motion.signals}
        known = completed(relations, {**asdict(self.parameters), **signals})
        known = completed(relations, known | balanced(relations, channel, known, count))
        gained = [name for name in relations.names if name not in self.relations.names]
        if not gained or any(name not in known for name in relations.signals):
            return None
        wider = extended(effects, self.parameters, motion, known, gained)
        return self._bounds(effects, wider, faults)

    @cached_property
    def motion(self) -> MotionSignals:
        """Signals of the recordings by the residual bank."""
        return self._of_all(self.effects)

    def _of_all(self, effects: EffectSet) -> MotionSignals:
        parts = [self._of_one(motion, effects) for motion in self.motions]
        names = parts[0].signals
        return MotionSignals(
            effects.residuals.weighed,
            {name: np.concatenate([part.signals[name] for part in parts]) for name in names},
            np.concatenate([part.regressors for part in parts]),
            np.concatenate([part.formed for part in parts]),
        )

    def _of_one(self, motion: RecordedMotion, effects: EffectSet) -> MotionSignals:
        known = effects.residuals
        rows = motion.in_order(known.channels)
        bank = ResidualBank(
            self.parameters,
            effects.relations,
            period_s=motion.period_s,
            counts=ScanCounts(motion.period_s, known.smoothing_s),
            backend="numpy",
        )
        residuals = bank.step(rows, frozen=False)
        table = RegressorTable(effects, self.parameters).rows(rows, residuals)
        regressors = table[:, : len(effects.names)]
        elapsed_s = np.mod((motion.stamps_ns - motion.stamps_ns[0]) * 1e-9, EPISODE_S)
        regressors[:, effects.names.index(str(ELAPSED))] = elapsed_s
        formed = np.isfinite(residuals.values[:, known.columns(known.weighed)])
        for column, name in enumerate(known.weighed):
            if name in known.in_motion:
                formed[:, column] &= residuals.moving
        signals = dict(zip(effects.relations.signals, residuals.signals.T, strict=True))
        for name, channel in known.predictions.items():
            read, off = rows[:, known.index[channel]], residuals.values[:, known.column(name)]
            signals[expected(channel).name] = read - off
        return MotionSignals(known.weighed, signals, regressors, formed)

    def _bounds(
        self, effects: EffectSet, motion: MotionSignals, faults: Collection[str]
    ) -> tuple[SizeBound, ...]:
        sigma, correlation = self._noise(effects.relations, motion)
        names = tuple(name for name in motion.names if name in sigma)
        healthy = NormalEquations(names, effects.basis_of(self.parameters))
        columns = [motion.names.index(name) for name in names]
        healthy.add(np.where(motion.formed[:, columns], 0.0, np.nan), motion.regressors)
        evidence = NormalEquations(names, healthy.basis)
        evidence.take(healthy, EPISODE_S / (len(motion.regressors) * self.period_s))
        known = effects.residuals
        settled = tuple(name for name in (known.circuit, known.friction) if name in names)
        bound = effects.bound(self.parameters)
        models = [m for m in bound if any(term.residual in names for term in m.terms)]
        rules = IsolatorParameters()
        return size_bounds(
            evidence,
            healthy,
            LikelihoodOf(
                models,
                sigma,
                correlation,
                self._tolerances(effects),
                rules.explain_nats,
                rules.drop_nats,
                settled,
            ),
            faults,
        )

    def _tolerances(self, effects: EffectSet) -> tuple[float, ...]:
        if self.calibration is not None:
            return self.calibration.differences(effects.differences)
        tolerance = tolerance_of(self.parameters, effects.relations)
        return difference_sigmas(tolerance, effects.differences)

    def _noise(
        self, relations: RelationSet, motion: MotionSignals
    ) -> tuple[dict[str, float], dict[str, float]]:
        """Scatter of each residual, and the samples to one independent sample."""
        counts = ScanCounts(self.period_s, relations.residuals.smoothing_s)
        kernels = hann_kernels(counts.kernel, self.period_s)
        gains = np.sqrt(np.square(kernels).sum(axis=1))
        sensors = described(self.stand.actuator).sensors
        known = {**asdict(self.parameters), **motion.signals}
        sigma: dict[str, float] = {}
        for row in relations.relations:
            parts = [
                _rms(evaluate(derivative(row.expression, name), known)) * gains[order] * noise
                for name in row.signals
                for channel, order in [channel_of(name)]
                if channel in sensors and (noise := sensors[channel].noise)
            ]
            sigma[row.name] = float(np.sqrt(np.square(parts).sum()))
        sigma |= {row.name: sensors[row.channel].noise for row in relations.predictions}
        correlation = dict.fromkeys(sigma, float(1.0 / np.square(kernels[0]).sum()))
        correlation |= {row.name: 1.0 for row in relations.predictions}
        if self.calibration is None:
            return sigma, correlation
        limits = {limit.name: limit for limit in self.calibration.limits if limit.name in sigma}
        friction, circuit = relations.residuals.friction, relations.residuals.circuit
        sigma |= {name: limit.sigma[0] for name, limit in limits.items()}
        own = own_sigma(self.calibration, (circuit, friction))
        sigma |= {name: value for name, value in own.items() if name in sigma}
        return sigma, correlation | {n: row.correlation_samples for n, row in limits.items()}


def _rms(values: object) -> float:
    read = np.asarray(values, dtype=np.float64)
    read = read[np.isfinite(read)]
    return float(np.sqrt(np.mean(np.square(read)))) if len(read) else 0.0
