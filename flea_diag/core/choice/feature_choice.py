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

"""Which feature to compute next, so that a group of faults splits at the least cost.

Four strategies with one interface: the criterion of Narasimhan et al. 2010, section 3.3, and
extensions for features that do not split, cost, prior probabilities and noise.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass
from functools import cached_property

from flea_diag.core.choice.fault_group import Group, entropy, normalised, outcomes, refine
from flea_diag.core.choice.feature_question import Question, Rules
from flea_diag.core.choice.feature_table import FaultFeatureTable
from flea_diag.errors import ConfigurationError, shown

__all__ = ["STRATEGIES", "FeatureChooser", "Rules", "next_feature", "outcomes", "refine"]

NEARER = (0.5, 0.2, 0.1, 0.05, 0.02)
"""Horizons of the first passes of a search; it may stop before the last."""

MOST_REMEMBERED = 4096
"""Choices cached with a table: the same groups recur."""


def partition_sizes(group: Group, table: FaultFeatureTable, feature: str) -> list[int]:
    """Sizes of the parts into which the most probable symbols divide the group."""
    values = [table.value(fault, feature) for fault in group]
    return [values.count(symbol) for symbol in dict.fromkeys(values)]


def _paper(question: Question) -> str | None:
    """Smallest difference between the largest and the smallest part: the paper, literally.

    A feature that does not split has one part, difference 0, and wins; kept for comparison.
    """
    features = [f for f in question.table.costs if f in question.prices]
    sizes = {f: partition_sizes(question.group, question.table, f) for f in features}
    return min(features, key=lambda f: max(sizes[f]) - min(sizes[f]), default=None)


def _balanced(question: Question) -> str | None:
    """The paper's criterion among features that split; ties by largest part, then by cost."""

    def key(feature: str) -> tuple[float, ...]:
        sizes = [len(left) for _, left in question.answers(feature)]
        return max(sizes) - min(sizes), max(sizes), question.prices[feature]

    return min(question.worth, key=key, default=None)


def _information(question: Question) -> str | None:
    """Largest expected drop of entropy per unit of cost, among features that split."""
    return max(question.gains, key=question.gains.__getitem__, default=None)


GREEDY: dict[str, Callable[[Question], str | None]] = {
    "paper": _paper,
    "balanced": _balanced,
    "information": _information,
}
STRATEGIES = (*GREEDY, "optimal")


class _TooManyStatesError(Exception):
    """The exact optimum would cost more than it saves."""


@dataclass
class _Node:
    """A group, a lower bound of its splitting cost, and the best plan found so far.

    Beyond the horizon the cost is estimated: the whole entropy at the best gain per cost of any
    feature. ``solved``: the nearest horizon for which ``cost`` is known to be minimal.
    """

    question: Question
    cost: float = math.inf
    choice: str | None = None
    solved: float = math.inf

    @cached_property
    def order(self) -> list[str]:
        """Features that split, largest gain per cost first, so that good plans are found early."""
        gains = self.question.gains
        return sorted(gains, key=gains.__getitem__, reverse=True)

    @cached_property
    def estimate(self) -> float:
        """Cost of splitting the group if all features were as good as the best.

        Near zero if one fault is almost certain: no feature gains anything there.
        """
        gain = self.question.gains[self.order[0]] if self.order else 0.0
        return entropy(self.question.group) / gain if gain > 0.0 else 0.0

    @cached_property
    def least(self) -> float:
        """Whether no plan costs less, nor the estimate."""
        prices = self.question.prices
        return min(self.estimate, min((prices[name] for name in self.order), default=0.0))


Key = tuple[tuple[tuple[str, float], ...], tuple[tuple[str, float], ...]]


def _key(group: Group, prices: Mapping[str, float]) -> Key:
    """Group and available features as a key; rounded, so that equal groups share one entry."""
    return tuple((fault, round(p, 9)) for fault, p in group.items()), tuple(prices.items())


class FeatureChooser:
    """Chooses by one strategy from one table, which caches the choices.

    ``optimal`` minimises J(G) = min over features of c_f + sum over v of P(v | G) J(G_v), with
    J = 0 where no feature splits G, by branch and bound over the groups that ``refine`` makes,
    memoised. It plans to a horizon: the cost of a group reached with less than that probability
    is estimated. Passes extend the horizon up to ``rules.horizon`` within ``rules.most_states``
    groups; the last complete pass decides. With a horizon and a ``rarest`` of 0 the plan is the
    optimum, for deterministic and noisy tables.
    """

    def __init__(
        self, table: FaultFeatureTable, strategy: str = "optimal", rules: Rules | None = None
    ) -> None:
        if strategy not in STRATEGIES:
            raise ConfigurationError(
                f"strategy {shown(strategy)} is unknown, choose one of {', '.join(STRATEGIES)}"
            )
        self.table = table
        self.strategy = strategy
        self.rules = rules or Rules()
        self._memory: dict[Key, _Node] = {}
        plan = strategy, self.rules
        self._choices: dict[Key, str | None] = table.plans.setdefault(plan, {})

    def next(
        self,
        group: Group,
        computed: Collection[str] = (),
        at_hand: Collection[str] = (),
    ) -> str | None:
        """Feature to compute next, or None if no feature can split the group (further).

        Parameters
        ----------
        computed : features already used to update the group, or not computable now
        at_hand : features whose answer is known but not yet used; they cost nothing
        """
        if len(group) < 2:
            return None
        prices = self._prices(computed, at_hand)
        question = Question(self._rounded(group), self.table, prices, self.rules)
        key = _key(question.group, question.prices)
        if key not in self._choices:
            if len(self._choices) >= MOST_REMEMBERED:
                self._choices.clear()
            choose = GREEDY.get(self.strategy, self._best)
            self._choices[key] = choose(question)
        return self._choices[key]

    def _rounded(self, group: Group) -> dict[str, float]:
        """The group with rounded probabilities; rounding drops no member."""
        least = 10.0**-self.rules.digits
        known = normalised(group)
        return normalised({f: max(round(p, self.rules.digits), least) for f, p in known.items()})

    def _best(self, question: Question) -> str | None:
        """First feature of the optimal plan, as far as it could be planned."""
        return self.plan(question)[0]

    def plan(self, question: Question) -> tuple[str | None, float]:
        """First feature, and the horizon of its optimality; infinite without a complete pass.

        Each search starts afresh: the choice must not depend on earlier questions.
        """
        self._memory.clear()
        found, reached, last = _information(question), math.inf, self.rules.horizon
        try:
            root = self._node(question.group, question.prices)
            for horizon in (*(near for near in NEARER if near > last), last):
                self._optimum(root, horizon, math.inf)
                found, reached = root.choice, horizon
        except _TooManyStatesError:
            pass
        return found, reached

    def _prices(self, computed: Collection[str], at_hand: Collection[str]) -> dict[str, float]:
        """Available features, cheapest first."""
        costs = {
            feature: 0.0 if feature in at_hand else self.table.costs[feature]
            for feature in self.table.features
            if feature not in computed
        }
        return dict(sorted(costs.items(), key=lambda item: (item[1], item[0])))

    def _node(self, group: Group, prices: Mapping[str, float]) -> _Node:
        """Search state of a group with these available features."""
        key = _key(group, prices)
        if key not in self._memory:
            if len(self._memory) >= self.rules.most_states:
                raise _TooManyStatesError
            self._memory[key] = _Node(Question(group, self.table, prices, self.rules))
        return self._memory[key]

    def _children(self, node: _Node, feature: str) -> list[tuple[float, _Node]]:
        """Groups, with probabilities, that are still to be split after a feature."""
        left = {name: price for name, price in node.question.prices.items() if name != feature}
        rows = node.question.answers(feature)
        return [(p, self._node(smaller, left)) for p, smaller in rows if len(smaller) > 1]

    def _optimum(self, node: _Node, horizon: float, budget: float) -> float:
        """Least expected cost to the leaves; infinite if no plan stays under the budget.

        ``horizon`` is relative to the probability of reaching this group.
        """
        if not node.order:
            return 0.0
        if horizon > 1.0:
            return node.estimate
        if node.solved <= horizon:
            return node.cost
        if node.least >= budget:
            return math.inf
        best = budget
        for feature in node.order:
            total = self._cost(node, feature, horizon, best)
            if total < best:
                best, node.cost, node.choice, node.solved = total, total, feature, horizon
        return best if best < budget else math.inf

    def _cost(self, node: _Node, feature: str, horizon: float, budget: float) -> float:
        """Expected cost to the leaves if this feature is next; exact only below the budget."""
        price = node.question.prices[feature]
        if price >= budget:
            return math.inf
        children = self._children(node, feature)
        total = price + math.fsum(p * child.least for p, child in children)
        for p, child in children:
            if total >= budget:
                break
            room = (budget - total) / p + child.least
            total += p * (self._optimum(child, horizon / p, room) - child.least)
        return total


def next_feature(
    group: Group,
    table: FaultFeatureTable,
    computed: Collection[str] = (),
    strategy: str = "optimal",
) -> str | None:
    """Choose one feature, without a chooser to keep: see `FeatureChooser.next`."""
    return FeatureChooser(table, strategy).next(group, computed)
