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

"""Next best test: which stand test would split the remaining group, how far, in what time.

Two kinds of test. A vibration feature: the group left follows from its table (Bayes). A motion
under load: the calibrated model predicts the signals, each fault of the group with its estimated
size predicts the residuals, and the likelihood test of the isolator determines which faults would
be dropped. Both give the expected size of the group, sum over f of P(f) * (faults left if f is
present). Tests are ranked by gain per second of stand time, after experiment design for
discrimination (Box and Hill 1967).

If no test with these sensors splits the group, the sensor whose features would is named.
Advice only: nothing here moves a stand.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from flea_diag.core.choice.fault_group import normalised, outcomes
from flea_diag.core.choice.feature_table import FaultFeatureTable
from flea_diag.core.choice.planned_motion import MOTIONS, PlannedMotion, planned
from flea_diag.core.likelihood.effect_set import EffectSet
from flea_diag.core.likelihood.fault_models import FaultModel
from flea_diag.core.likelihood.fit import Fit
from flea_diag.core.likelihood.likelihood import NormalEquations
from flea_diag.core.residuals.parameters import ActuatorParameters
from flea_diag.core.vibration.features import FeatureId

Array = npt.NDArray[np.float64]

FEATURE_S = 1.0
"""Stand time of one feature: a window of vibration in motion."""
WORTH_SIZE = 0.05
"""Least expected reduction of the group size; a test with less does not split."""


@dataclass(frozen=True)
class StandTest:
    """One test: how long it takes, the group's expected size after it, and what it splits.

    ``kind`` is ``feature``, ``motion`` or ``sensor``; a sensor that is not there takes no time
    (NaN), and ``expected_size`` is what its features would then leave.
    """

    kind: str
    what: str
    seconds: float
    expected_size: float
    splits: tuple[tuple[str, str], ...]


@dataclass(frozen=True)
class Suspect:
    """A remaining fault: its probability, and its best fit if it has one."""

    fault: str
    probability: float
    fit: Fit | None = None


@dataclass(frozen=True)
class LikelihoodTest:
    """Models, noise and drop limit of the isolator's likelihood test."""

    models: Sequence[FaultModel]
    sigma: Mapping[str, float]
    correlation: Mapping[str, float]
    tolerance: Sequence[float]
    drop_nats: float


def next_tests(
    suspects: Sequence[Suspect],
    motions: Sequence[StandTest],
    features: Sequence[StandTest],
    sensors: Sequence[StandTest],
) -> tuple[StandTest, ...]:
    """Tests that split the group, highest gain per second first; sensors only if no test does."""
    size = len(suspects)
    splitting = [t for t in (*features, *motions) if t.splits]
    splitting.sort(key=lambda t: (-(size - t.expected_size) / t.seconds, t.what))
    return tuple(splitting or sorted(sensors, key=lambda t: (t.expected_size, t.what)))


def feature_tests(
    suspects: Sequence[Suspect],
    table: FaultFeatureTable,
    axes: Collection[str],
    tried: Collection[str] = (),
) -> tuple[tuple[StandTest, ...], tuple[StandTest, ...]]:
    """Features that would split the group: those computable here, and sensors to be fitted."""
    group = normalised({s.fault: s.probability for s in suspects})
    here: list[StandTest] = []
    missing: dict[str, StandTest] = {}
    for feature in table.features:
        size, splits = _after_feature(group, table, feature)
        if len(group) - size < WORTH_SIZE:
            continue
        sensor = FeatureId.parse(feature).accelerometer or "accelerometer"
        if any(axis.startswith(sensor) for axis in axes):
            if feature not in tried:
                here.append(StandTest("feature", feature, FEATURE_S, size, splits))
        elif not axes and (sensor not in missing or size < missing[sensor].expected_size):
            missing[sensor] = StandTest("sensor", sensor, math.nan, size, splits)
    return tuple(here), tuple(missing.values())


def _after_feature(
    group: Mapping[str, float], table: FaultFeatureTable, feature: str
) -> tuple[float, tuple[tuple[str, str], ...]]:
    """Expected size of the group after a feature, and the pairs split by some answer."""
    answers = outcomes(group, table, feature).values()
    size = sum(p * len(left) for p, left in answers)
    names = sorted(group)
    splits = tuple(
        (one, two)
        for place, one in enumerate(names)
        for two in names[place + 1 :]
        if any((one in left) != (two in left) for _, left in answers)
    )
    return size, splits


def motion_tests(
    suspects: Sequence[Suspect],
    evidence: NormalEquations,
    test: LikelihoodTest,
    effects: EffectSet,
    parameters: ActuatorParameters,
    elapsed_s: float = 0.0,
    motions: Sequence[PlannedMotion] = MOTIONS,
) -> tuple[StandTest, ...]:
    """Expected group after each motion, added to the evidence so far.

    A fault without a fitted model can be neither dropped by likelihood nor predicted.
    """
    found = []
    for motion in motions:
        phi = planned(effects, parameters, motion, elapsed_s)
        dropped = {
            s.fault: _dropped(s, suspects, evidence, phi, test)
            for s in suspects
            if s.fit is not None
        }
        total = sum(s.probability for s in suspects)
        size = sum(
            s.probability / total * (len(suspects) - len(dropped.get(s.fault, ())))
            for s in suspects
        )
        if len(suspects) - size >= WORTH_SIZE:
            splits = _pairs(dropped)
            found.append(StandTest("motion", motion.name, motion.seconds, size, splits))
    return tuple(found)


def _pairs(dropped: Mapping[str, Collection[str]]) -> tuple[tuple[str, str], ...]:
    """Pairs of which one, if present, drops the other."""
    pairs = {
        (min(truth, gone), max(truth, gone)) for truth, faults in dropped.items() for gone in faults
    }
    return tuple(sorted(pairs))


def _dropped(
    truth: Suspect,
    suspects: Sequence[Suspect],
    evidence: NormalEquations,
    phi: Array,
    test: LikelihoodTest,
) -> tuple[str, ...]:
    """Faults that the likelihood would drop if ``truth`` were present, in its estimated size."""
    assert truth.fit is not None
    names = {s.fault for s in suspects if s.fit is not None}
    models = [model for model in test.models if model.fault in names]
    count = len(truth.fit.sizes)
    own = next(m for m in models if m.fault == truth.fault and len(m.sizes) == count)
    foreseen = evidence.foreseen(phi, own, truth.fit.sizes)
    best: dict[str, float] = {}
    for fit in foreseen.fit(models, test.sigma, test.correlation, test.tolerance):
        best[fit.fault] = max(fit.log_likelihood, best.get(fit.fault, -math.inf))
    leader = max(best.values())
    return tuple(f for f, nats in best.items() if leader - nats > test.drop_nats)
