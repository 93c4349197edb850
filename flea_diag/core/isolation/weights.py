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

"""What the residuals of an episode weigh: their noise, and what a healthy unit may differ by."""

from __future__ import annotations

import math
from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace

from flea_diag.core.calibration.calibration import Calibration
from flea_diag.core.calibration.run_noise import run_noise
from flea_diag.core.likelihood.effect_set import EffectSet


@dataclass(frozen=True)
class Weights:
    """Noise of the residuals, and what a healthy unit may differ by.

    Attributes
    ----------
    sigma
        Scatter of each residual.
    own_sigma
        The same about the level that the unit has shown in the balance of forces as well.
    correlation
        Samples to one independent sample.
    tolerances
        In the order of ``EffectSet.differences``.
    run_share
        Of the variance of each difference what already the recordings of one unit differ by, in the
        same order; 0 where the calibration holds no law of its recordings.
    """

    sigma: dict[str, float]
    own_sigma: dict[str, float]
    correlation: dict[str, float]
    tolerances: tuple[float, ...]
    run_share: tuple[float, ...]

    @classmethod
    def of(cls, calibration: Calibration, effects: EffectSet) -> Weights:
        """Those of a calibration: of the circuit within one run, where that is known.

        The balance of forces keeps its scatter over recordings: its friction varies along the
        travel as well.
        """
        circuit, friction = effects.residuals.circuit, effects.residuals.friction
        sigma = {limit.name: limit.sigma[0] for limit in calibration.limits}
        correlation = {limit.name: limit.correlation_samples for limit in calibration.limits}
        own = sigma | own_sigma(calibration, (circuit, friction))
        units = {name for name, effect in effects.units if effect.residual == circuit}
        run = run_noise(calibration, circuit, units)
        if run is not None:
            sigma[circuit] = own[circuit] = run.sigma
            correlation[circuit] = run.correlation
            calibration = replace(calibration, tolerance=run.tolerance)
        tolerances = calibration.differences(effects.differences)
        return cls(sigma, own, correlation, tolerances, run_share(calibration, effects, tolerances))


def run_share(
    calibration: Calibration, effects: EffectSet, tolerances: Sequence[float]
) -> tuple[float, ...]:
    """Share of each difference's variance that recordings of one unit differ by; at most 1."""
    terms = calibration.law.terms if calibration.law else ()
    of_runs = {term.name: term.run_sigma for term in terms if not term.relation}
    return tuple(
        min((of_runs.get(name, 0.0) / tolerance) ** 2, 1.0)
        for name, tolerance in zip(effects.differences, tolerances, strict=True)
    )


def own_sigma(calibration: Calibration, residuals: Collection[str]) -> dict[str, float]:
    """Scatter of the relations about the level of one unit, from the limits of their shift tests.

    The scatter over all recordings includes the variation between units.
    """
    found = {}
    for shift in calibration.mean_shifts:  # of one relation, the longest window comes last
        limit = calibration.limit(shift.name)
        if shift.name in residuals and limit is not None:
            independent = shift.window / limit.correlation_samples
            found[shift.name] = min(shift.sigma * math.sqrt(independent), limit.sigma[0])
    return found
