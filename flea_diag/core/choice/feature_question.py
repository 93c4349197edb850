"""What choosing a feature starts from: a group, features with prices, and what each may answer."""

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
"""A probability that is next to nothing, to divide by."""

WORTH_ODDS = 4.0
"""Shift of the odds between two faults for which a feature is computed."""

RAREST = 0.01
"""Answers less probable than this are not planned for."""

HORIZON = 0.01
"""Groups reached with less probability than this are estimated, not planned."""

MOST_STATES = 30
"""Groups that the search for the optimum looks at: some three thousandths of a second. Three times
as many save less of features than they cost themselves."""

DIGITS = 2
"""To which probabilities are rounded before choosing, so that groups come again: see `plans`."""


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
    """What a strategy is asked: the group, and the features to choose from with prices.

    The group is normalised and in order of names. All answers of all features are worked out at
    once, as arrays: a search asks hundreds of such questions. `outcomes` says the same in words.
    """

    group: Group
    table: FaultFeatureTable
    prices: Mapping[str, float]
    rules: Rules

    @cached_property
    def probability(self) -> Floats:
        """Of each answer, shape (features, symbols); 0 where it is too rare to be planned for."""
        total = self._joint.sum(axis=2)
        return np.where(total > self.rules.rarest, total, 0.0)

    @cached_property
    def left(self) -> Floats:
        """Groups after each answer, 0 for who is out, shape (features, symbols, faults)."""
        with np.errstate(invalid="ignore", divide="ignore"):
            after = self._joint / self._joint.sum(axis=2, keepdims=True)
            after[~(after >= self.rules.drop_below)] = 0.0
            return np.asarray(np.nan_to_num(after / after.sum(axis=2, keepdims=True)))

    @cached_property
    def worth(self) -> list[str]:
        """Features of which some answer drops a member or shifts the odds between two by much.

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
        """Expected drop of entropy, in bits per unit of cost, of the features that are worth it."""
        left = self.left
        bits = -(left * np.log2(np.where(left > 0.0, left, 1.0))).sum(axis=2)
        expected = (self.probability * bits).sum(axis=1)
        drops = dict(zip(self.prices, (entropy(self.group) - expected).tolist(), strict=True))
        return {name: drops[name] / max(self.prices[name], 1e-9) for name in self.worth}

    def answers(self, feature: str) -> list[tuple[float, dict[str, float]]]:
        """Probability of each answer of one feature, and the group that it leaves."""
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
