"""Which feature to compute next, so that a group of faults splits at the least cost.

Four strategies behind one interface (Narasimhan et al. 2010, section 3.3, and what its
criterion leaves out: features that do not split, cost, prior probabilities and noise).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass
from functools import cached_property

from flea_diag.core.feature_table import FaultFeatureTable
from flea_diag.errors import ConfigurationError

Group = Mapping[str, float]
"""Faults still possible, each with its probability."""

DROP_BELOW = 0.02
"""A fault whose probability falls below this leaves the group for good."""

WORTH_ODDS = 4.0
"""Shift of the odds between two faults for which a feature is computed."""

RAREST = 0.01
"""Answers less probable than this are not planned for."""

MOST_STATES = 1000
"""Groups that the optimum looks at before it gives way to gain per cost."""


def normalised(group: Group) -> dict[str, float]:
    """Group whose probabilities sum to 1, by name."""
    total = math.fsum(group.values())
    return {fault: group[fault] / total for fault in sorted(group)} if total > 0.0 else {}


def refine(
    group: Group,
    table: FaultFeatureTable,
    feature: str,
    symbol: str,
    drop_below: float = DROP_BELOW,
) -> dict[str, float]:
    """Group after one answer: Bayes with P(symbol | fault), then the improbable leave.

    Never grows. Empty where no fault of the group can give this symbol; unchanged by ``?``.
    """
    if symbol == "?":
        return normalised(group)
    place = table.place(symbol)
    return _after(
        {fault: p * table.probabilities(fault, feature)[place] for fault, p in group.items()},
        drop_below,
    )


def _after(joint: Group, drop_below: float) -> dict[str, float]:
    """Posterior of joint probabilities, without those below the limit."""
    posterior = normalised(joint)
    left = {fault: p for fault, p in posterior.items() if p >= drop_below and p > 0.0}
    return posterior if len(left) == len(posterior) else normalised(left)


def outcomes(
    group: Group,
    table: FaultFeatureTable,
    feature: str,
    drop_below: float = DROP_BELOW,
    rarest: float = 0.0,
) -> dict[str, tuple[float, dict[str, float]]]:
    """Symbol -> (probability, group left), for each symbol more probable than ``rarest``.

    The probabilities of ``group`` must sum to 1.
    """
    rows = [(fault, p, table.probabilities(fault, feature)) for fault, p in group.items()]
    found: dict[str, tuple[float, dict[str, float]]] = {}
    for place, symbol in enumerate(table.alphabet):
        joint = {fault: p * row[place] for fault, p, row in rows}
        total = sum(joint.values())
        if total > rarest:
            found[symbol] = total, _after(joint, drop_below)
    return found


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


def entropy(group: Group) -> float:
    """Shannon entropy of a group in bits."""
    return -math.fsum(p * math.log2(p) for p in normalised(group).values() if p > 0.0)


GREEDY: dict[str, Callable[[_Question], str | None]] = {
    "paper": _paper,
    "balanced": _balanced,
    "information": _information,
}
STRATEGIES = (*GREEDY, "optimal")


class _TooManyStatesError(Exception):
    """The exact optimum would cost more than it saves."""


class FeatureChooser:
    """Chooses by one strategy over one table, and remembers what the optimum worked out.

    ``optimal`` minimises J(G) = min over features of c_f + sum over v of P(v | G) J(G_v), with
    J = 0 where no feature splits G, by memoised recursion over the groups that ``refine``
    makes; exact for hard and for noisy tables but for the answers rarer than
    ``rules.rarest``. Past ``rules.most_states`` groups it answers by gain per cost instead.
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
        self._memory: dict[tuple[object, ...], tuple[float, str | None]] = {}

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
        prices = self._prices(computed, at_hand)
        question = _Question(normalised(group), self.table, prices, self.rules)
        if self.strategy != "optimal":
            return GREEDY[self.strategy](question)
        try:
            return self._optimum(question.group, prices, len(self._memory))[1]
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

    def _optimum(
        self, group: Group, prices: Mapping[str, float], known: int
    ) -> tuple[float, str | None]:
        """Expected cost to the leaves and the first feature on the way, memoised."""
        if len(group) < 2:
            return 0.0, None
        key = (tuple((fault, round(p, 9)) for fault, p in group.items()), tuple(prices))
        if key not in self._memory:
            if len(self._memory) - known >= self.rules.most_states:
                raise _TooManyStatesError
            self._memory[key] = self._cheapest(group, prices, known)
        return self._memory[key]

    def _cheapest(
        self, group: Group, prices: Mapping[str, float], known: int
    ) -> tuple[float, str | None]:
        """Minimum over features, the most promising first so that the rest is soon cut off."""
        question = _Question(group, self.table, prices, self.rules)
        gains = _gains(question)
        best, choice = math.inf, None
        for feature in sorted(gains, key=lambda name: -gains[name]):
            left = {name: price for name, price in prices.items() if name != feature}
            total = prices[feature]
            for p, smaller in question.answers[feature].values():
                if total >= best:
                    break
                total += p * self._optimum(smaller, left, known)[0]
            if total < best:
                best, choice = total, feature
        return (best, choice) if choice else (0.0, None)


def next_feature(
    group: Group,
    table: FaultFeatureTable,
    computed: Collection[str] = (),
    strategy: str = "optimal",
    rules: Rules | None = None,
) -> str | None:
    """Choose one feature, without a chooser to keep: see `FeatureChooser.next`."""
    return FeatureChooser(table, strategy, rules).next(group, computed)
