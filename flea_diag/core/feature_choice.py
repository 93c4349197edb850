"""Which feature to compute next, so that a group of faults splits at the least cost.

Four strategies behind one interface (Narasimhan et al. 2010, section 3.3, and what its
criterion leaves out: features that do not split, cost, prior probabilities and noise).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass
from functools import cached_property

from flea_diag.core.fault_group import (
    DROP_BELOW,
    Group,
    entropy,
    normalised,
    outcomes,
    refine,
)
from flea_diag.core.feature_table import FaultFeatureTable
from flea_diag.errors import ConfigurationError

__all__ = ["STRATEGIES", "FeatureChooser", "Rules", "next_feature", "outcomes", "refine"]

WORTH_ODDS = 4.0
"""Shift of the odds between two faults for which a feature is computed."""

RAREST = 0.01
"""Answers less probable than this are not planned for."""

ROUGH_BELOW = 0.05
"""Groups reached with less probability than this are not worth an exact plan."""

MOST_STATES = 2000
"""Groups that the search for the optimum looks at: under a tenth of a second."""


def partition_sizes(group: Group, table: FaultFeatureTable, feature: str) -> list[int]:
    """Sizes of the parts into which the most probable symbols put the group."""
    values = [table.value(fault, feature) for fault in group]
    return [values.count(symbol) for symbol in dict.fromkeys(values)]


@dataclass(frozen=True)
class Rules:
    """Limits of choosing: see the constants of the same names."""

    drop_below: float = DROP_BELOW
    worth_odds: float = WORTH_ODDS
    rarest: float = RAREST
    rough_below: float = ROUGH_BELOW
    most_states: int = MOST_STATES


@dataclass(frozen=True)
class _Question:
    """What a strategy is asked: the group, and the features to choose from with prices."""

    group: Group
    table: FaultFeatureTable
    prices: Mapping[str, float]
    rules: Rules

    @cached_property
    def answers(self) -> dict[str, dict[str, tuple[float, dict[str, float]]]]:
        """Outcomes of the features that are worth computing, cheapest first."""
        rules = self.rules
        found = {
            feature: outcomes(self.group, self.table, feature, rules.drop_below, rules.rarest)
            for feature in self.prices
        }
        return {feature: rows for feature, rows in found.items() if self._is_worth(rows)}

    def splitting(self) -> list[tuple[str, float]]:
        """Features that are worth computing with their prices, cheapest first."""
        return [(feature, self.prices[feature]) for feature in self.answers]

    def _is_worth(self, rows: Mapping[str, tuple[float, dict[str, float]]]) -> bool:
        """Whether some answer drops a member or shifts the odds between two by much.

        A noisy feature may split a group only together with others.
        """
        return any(
            len(left) < len(self.group) or _shift(self.group, left) >= self.rules.worth_odds
            for _, left in rows.values()
        )


def _shift(before: Group, after: Group) -> float:
    """Largest factor by which the odds between two faults have changed."""
    changes = [p / before[fault] for fault, p in after.items()]
    return max(changes) / min(changes) if changes else 1.0


def _paper(question: _Question) -> str | None:
    """Smallest difference between the largest and the smallest part, read literally.

    A feature that does not split makes one part, difference 0, and wins: kept to compare.
    """
    features = [f for f in question.table.costs if f in question.prices]
    sizes = {f: partition_sizes(question.group, question.table, f) for f in features}
    return min(features, key=lambda f: max(sizes[f]) - min(sizes[f]), default=None)


def _balanced(question: _Question) -> str | None:
    """As the paper, among features that split; then the smallest largest part, then price."""

    def key(feature: str) -> tuple[float, ...]:
        sizes = [len(left) for _, left in question.answers[feature].values()]
        return max(sizes) - min(sizes), max(sizes), question.prices[feature]

    return min(question.answers, key=key, default=None)


def _information(question: _Question) -> str | None:
    """Largest expected drop of entropy per unit of cost, among features that split."""
    gains = _gains(question)
    return max(gains, key=gains.__getitem__, default=None)


def _gains(question: _Question) -> dict[str, float]:
    """Expected drop of entropy per unit of cost of each feature that splits."""
    before = entropy(question.group)
    return {
        feature: (before - sum(p * entropy(left) for p, left in rows.values()))
        / max(question.prices[feature], 1e-9)
        for feature, rows in question.answers.items()
    }


GREEDY: dict[str, Callable[[_Question], str | None]] = {
    "paper": _paper,
    "balanced": _balanced,
    "information": _information,
}
STRATEGIES = (*GREEDY, "optimal")


class _TooManyStatesError(Exception):
    """The exact optimum would cost more than it saves."""


@dataclass
class _Node:
    """A group, the least and the most that splitting it may cost, and the best feature so far.

    ``solved``: the probability of being reached for which ``most`` is known to be the optimum.
    """

    question: _Question
    least: float = 0.0
    most: float = math.inf
    choice: str | None = None
    solved: float = 0.0

    def __post_init__(self) -> None:
        """Start from what any way must cost: the cheapest feature that splits."""
        self.least = min((price for _, price in self.question.splitting()), default=0.0)


Key = tuple[tuple[tuple[str, float], ...], tuple[tuple[str, float], ...]]


def _key(group: Group, prices: Mapping[str, float]) -> Key:
    """Group and features to choose from as a key; rounded, for the same group reached twice."""
    return tuple((fault, round(p, 9)) for fault, p in group.items()), tuple(prices.items())


class FeatureChooser:
    """Chooses by one strategy over one table, and remembers what it has chosen.

    ``optimal`` minimises J(G) = min over features of c_f + sum over v of P(v | G) J(G_v), with
    J = 0 where no feature splits G, by branch and bound over the groups that ``refine`` makes,
    memoised; exact for hard and for noisy tables when ``rules.rarest`` and
    ``rules.rough_below`` are 0. By default answers rarer than ``rarest`` are not planned for, and
    groups that are reached with less than ``rough_below`` are priced by gain per cost, which
    also answers past ``most_states`` groups: so it never costs more than gain per cost.
    """

    def __init__(
        self, table: FaultFeatureTable, strategy: str = "optimal", rules: Rules | None = None
    ) -> None:
        if strategy not in STRATEGIES:
            raise ConfigurationError(
                f"strategy {strategy!r} is unknown, choose one of {', '.join(STRATEGIES)}"
            )
        self.table = table
        self.strategy = strategy
        self.rules = rules or Rules()
        self._memory: dict[Key, _Node] = {}
        self._choices: dict[Key, str | None] = {}

    def next(
        self,
        group: Group,
        computed: Collection[str] = (),
        at_hand: Collection[str] = (),
    ) -> str | None:
        """Feature to compute next, or None when nothing (more) can split the group.

        Parameters
        ----------
        computed : features already folded into the group, or known not to be computable now
        at_hand : features whose answer is known but not yet folded in; they cost nothing
        """
        if len(group) < 2:
            return None
        question = _Question(
            normalised(group), self.table, self._prices(computed, at_hand), self.rules
        )
        key = _key(question.group, question.prices)
        if key not in self._choices:
            choose = GREEDY.get(self.strategy, self._best)
            self._choices[key] = choose(question)
        return self._choices[key]

    def _best(self, question: _Question) -> str | None:
        """First feature of the optimum, or of gain per cost where that would search too long.

        Starts from nothing each time: what is chosen must not depend on what was asked before.
        What a cut-off search has found is not used: only whole plans keep their promise of
        costing no more than gain per cost.
        """
        self._memory.clear()
        try:
            node = self._node(question.group, question.prices)
            self._optimum(node, 1.0, math.inf)
            return node.choice
        except _TooManyStatesError:
            return _information(question)

    def _prices(self, computed: Collection[str], at_hand: Collection[str]) -> dict[str, float]:
        """Features to choose from, cheapest first."""
        costs = {
            feature: 0.0 if feature in at_hand else self.table.costs[feature]
            for feature in self.table.features
            if feature not in computed
        }
        return dict(sorted(costs.items(), key=lambda item: (item[1], item[0])))

    def _node(self, group: Group, prices: Mapping[str, float]) -> _Node:
        """What is known of a group with these features to choose from."""
        key = _key(group, prices)
        if key not in self._memory:
            if len(self._memory) >= self.rules.most_states:
                raise _TooManyStatesError
            self._memory[key] = _Node(_Question(group, self.table, prices, self.rules))
        return self._memory[key]

    def _greedy_cost(self, node: _Node) -> float:
        """Expected cost of gain per cost all the way down: the optimum costs at most this."""
        if math.isinf(node.most):
            feature = _information(node.question)
            node.most = 0.0 if feature is None else node.question.prices[feature]
            for p, child in self._children(node, feature):
                node.most += p * self._greedy_cost(child)
            node.choice = feature
        return node.most

    def _children(self, node: _Node, feature: str | None) -> list[tuple[float, _Node]]:
        """Groups, with probabilities, that are still to be split after a feature."""
        if feature is None:
            return []
        left = {name: price for name, price in node.question.prices.items() if name != feature}
        rows = node.question.answers[feature].values()
        return [(p, self._node(smaller, left)) for p, smaller in rows if len(smaller) > 1]

    def _optimum(self, node: _Node, reach: float, budget: float) -> float:
        """Least expected cost to the leaves; infinite where no way stays under the budget.

        ``reach`` is the probability of coming to this group at all.
        """
        if reach < self.rules.rough_below:
            return self._greedy_cost(node)
        if node.solved >= reach:
            return node.most
        if node.least >= budget:
            return math.inf
        best = min(self._greedy_cost(node), budget)
        for feature, price in node.question.splitting():
            children = self._children(node, feature)
            total = price + sum(p * child.least for p, child in children)
            for p, child in children:
                if total >= best:
                    break
                room = (best - total) / p + child.least
                total += p * (self._optimum(child, reach * p, room) - child.least)
            if total < best:
                best, node.most, node.choice = total, total, feature
        if node.most <= best:
            node.solved = reach
            return node.most
        return math.inf


def next_feature(
    group: Group,
    table: FaultFeatureTable,
    computed: Collection[str] = (),
    strategy: str = "optimal",
    rules: Rules | None = None,
) -> str | None:
    """Choose one feature, without a chooser to keep: see `FeatureChooser.next`."""
    return FeatureChooser(table, strategy, rules).next(group, computed)
