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

"""The input of a feature choice: a group, features with costs, and their possible answers."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt

from flea_diag.core.choice.fault_group import DROP_BELOW, Group, entropy
from flea_diag.core.choice.feature_table import FaultFeatureTable

Floats = npt.NDArray[np.float64]

LEAST = 1e-300
"""A negligible probability, so that divisions are defined."""

WORTH_ODDS = 4.0
"""Shift of the odds between two faults from which a feature is worth computing."""

RAREST = 0.01
"""Answers less probable than this are not planned for."""

HORIZON = 0.01
"""Groups reached with less probability than this are estimated, not planned."""

MOST_STATES = 30
"""Largest number of groups in the search for the optimum, about 3 ms. A search three times as
large saves less than it costs."""

DIGITS = 2
"""Rounding of probabilities before choosing, so that cached plans are found: see `plans`."""


@dataclass(frozen=True)
class Rules:
    """Limits of choosing: see the constants of the same names."""

    drop_below: float = DROP_BELOW
    worth_odds: float = WORTH_ODDS
    rarest: float = RAREST
    horizon: float = HORIZON
    most_states: int = MOST_STATES
    digits: int = DIGITS


@dataclass(frozen=True)
class Question:
    """The input of a strategy: the group, and the available features with their costs.

    The group is normalised and sorted by name. All answers of all features are computed at once
    as arrays, because a search evaluates hundreds of groups. `outcomes` is the readable form.
    """

    group: Group
    table: FaultFeatureTable
    prices: Mapping[str, float]
    rules: Rules

    @cached_property
    def probability(self) -> Floats:
        """Probability of each answer, shape (features, symbols); 0 if too rare to plan for."""
        total = self._joint.sum(axis=2)
        return np.where(total > self.rules.rarest, total, 0.0)

    @cached_property
    def left(self) -> Floats:
        """Groups after each answer, shape (features, symbols, faults); 0 for dropped faults."""
        with np.errstate(invalid="ignore", divide="ignore"):
            after = self._joint / self._joint.sum(axis=2, keepdims=True)
            after[~(after >= self.rules.drop_below)] = 0.0
            return np.asarray(np.nan_to_num(after / after.sum(axis=2, keepdims=True)))

    @cached_property
    def worth(self) -> list[str]:
        """Features with an answer that drops a member or shifts the odds of two strongly.

        Cheapest first. A noisy feature may split a group only together with others.
        """
        kept, left = self.probability > 0.0, self.left
        change = left / np.maximum(self._before, LEAST)
        least = np.where(left > 0.0, change, math.inf).min(axis=2)
        shifted = change.max(axis=2) >= self.rules.worth_odds * least
        splits = (kept & (shifted | (left == 0.0).any(axis=2))).any(axis=1)
        return [feature for feature, keep in zip(self.prices, splits, strict=True) if keep]

    @cached_property
    def gains(self) -> dict[str, float]:
        """Expected drop of entropy of the useful features, in bits per unit of cost."""
        left = self.left
        bits = -(left * np.log2(np.where(left > 0.0, left, 1.0))).sum(axis=2)
        expected = (self.probability * bits).sum(axis=1)
        drops = dict(zip(self.prices, (entropy(self.group) - expected).tolist(), strict=True))
        return {name: drops[name] / max(self.prices[name], 1e-9) for name in self.worth}

    def answers(self, feature: str) -> list[tuple[float, dict[str, float]]]:
        """Probability of each answer of one feature, and the remaining group."""
        place = list(self.prices).index(feature)
        return [
            (p, {fault: q for fault, q in zip(self.group, row, strict=True) if q > 0.0})
            for p, row in zip(
                self.probability[place].tolist(), self.left[place].tolist(), strict=True
            )
            if p > 0.0
        ]

    @cached_property
    def _before(self) -> Floats:
        return np.array(list(self.group.values()))

    @cached_property
    def _joint(self) -> Floats:
        """P(answer and fault), shape (features, symbols, faults)."""
        rows = self.table.matrix(tuple(self.group), tuple(self.prices))
        return rows * self._before
