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

"""Signals of recordings, and what one more sensor would have read."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from flea_diag.core.likelihood.effect_set import EffectSet
from flea_diag.core.likelihood.effects import ELAPSED
from flea_diag.core.residuals.parameters import ActuatorParameters
from flea_diag.core.residuals.relation_set import RelationSet
from flea_diag.core.symbolic.expression import derivative, evaluate

Array = npt.NDArray[np.float64]
STEPS = 5
"""Of Newton's method: a balance with a friction by load is linear in two pieces."""


@dataclass(frozen=True)
class MotionSignals:
    """Signals of all recordings: regressors of the fault models, and which residuals there are.

    ``formed``, shape (scans, residuals), order of ``names``.
    """

    names: tuple[str, ...]
    signals: Mapping[str, Array]
    regressors: Array
    formed: npt.NDArray[np.bool_]


def balanced(
    relations: RelationSet, channel: str, known: Mapping[str, Array], count: int
) -> dict[str, Array]:
    """Readings of a channel, shape (count,), at which the relation that lacks it alone is 0."""
    for row in relations.relations:
        if [name for name in row.signals if name not in known] == [channel]:
            slope = derivative(row.expression, channel)
            read = np.zeros(count)
            for _ in range(STEPS):
                at = {**known, channel: read}
                read = read - evaluate(row.expression, at) / evaluate(slope, at)
            return {channel: read}
    return {}


def extended(
    effects: EffectSet,
    p: ActuatorParameters,
    motion: MotionSignals,
    known: Mapping[str, Array],
    gained: Sequence[str],
) -> MotionSignals:
    """The motion with relations that one more channel closes, wherever their signals are known."""
    count = len(motion.regressors)
    inside = {n: evaluate(e, known) for n, e in effects.shapes.items() if n not in known}
    found = {**known, **inside}
    x = [np.asarray(found.get(name, np.full(count, np.nan))) for name in effects.signals]
    regressors = np.empty((count, len(effects.names)))
    for number, column in enumerate(effects.functions["columns"](p, x)):
        regressors[:, number] = column
    elapsed = effects.names.index(str(ELAPSED))
    regressors[:, elapsed] = motion.regressors[:, elapsed]
    formed = motion.formed.copy()
    for name in gained:
        read = [known[signal] for signal in effects.relations.named[name].signals]
        formed[:, motion.names.index(name)] = np.isfinite(read).all(axis=0)
    return MotionSignals(motion.names, known, regressors, formed)
