"""Which feature to compute next, so that a group of faults splits at the least cost.

Four strategies behind one interface (Narasimhan et al. 2010, section 3.3, and what its
criterion leaves out: features that do not split, cost, prior probabilities and noise).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass

from flea_diag.core.feature_table import FaultFeatureTable
from flea_diag.errors import ConfigurationError

Group = Mapping[str, float]
"""Faults still possible, each with its probability."""

DROP_BELOW = 0.02
"""A fault whose probability falls below this leaves the group for good."""

MOST_STATES = 4000
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
    posterior = normalised(
        {fault: p * table.probability(fault, feature, symbol) for fault, p in group.items()}
    )
    return normalised({fault: p for fault, p in posterior.items() if p >= drop_below})


def outcomes(
    group: Group, table: FaultFeatureTable, feature: str, drop_below: float = DROP_BELOW
) -> dict[str, tuple[float, dict[str, float]]]:
    """Symbol -> (probability, group left), for each symbol that the group can give."""
    group = normalised(group)
    found: dict[str, tuple[float, dict[str, float]]] = {}
    for symbol in table.alphabet:
        p = math.fsum(
            prior * table.probability(fault, feature, symbol) for fault, prior in group.items()
        )
        if p > 0.0:
            found[symbol] = p, refine(group, table, feature, symbol, drop_below)
    return found


def splits(
    group: Group, table: FaultFeatureTable, feature: str, drop_below: float = DROP_BELOW
) -> bool:
    """Whether some answer would drop a member: only such a feature is worth computing."""
    return any(
        len(left) < len(group) for _, left in outcomes(group, table, feature, drop_below).values()
    )


def partition_sizes(group: Group, table: FaultFeatureTable, feature: str) -> list[int]:
    """Sizes of the parts into which the most probable symbols put the group."""
    values = [table.value(fault, feature) for fault in group]
    return [values.count(symbol) for symbol in dict.fromkeys(values)]


@dataclass(frozen=True)
class _Question:
    """What a strategy is asked: the group, the features to choose from and their prices."""

    group: Group
    table: FaultFeatureTable
    prices: Mapping[str, float]
    drop_below: float

    def splitting(self) -> list[str]:
        """Features that split the group, cheapest first."""
        return [f for f in self.prices if splits(self.group, self.table, f, self.drop_below)]

    def outcomes(self, feature: str) -> dict[str, tuple[float, dict[str, float]]]:
        """Answers that a feature can give to this group."""
        return outcomes(self.group, self.table, feature, self.drop_below)


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
        sizes = [len(left) for _, left in question.outcomes(feature).values()]
        return max(sizes) - min(sizes), max(sizes), question.prices[feature]

    return min(question.splitting(), key=key, default=None)


def _information(question: _Question) -> str | None:
    """Largest expected drop of entropy per unit of cost, among features that split."""
    before = entropy(question.group)

    def gain(feature: str) -> float:
        after = math.fsum(p * entropy(left) for p, left in question.outcomes(feature).values())
        return (before - after) / max(question.prices[feature], 1e-9)

    return max(question.splitting(), key=gain, default=None)


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

    ``optimal`` minimises J(G) = min over features of c_f + sum over v of P(v | G) J(G_v) with
    J = 0 where nothing splits G, by memoised recursion over the groups that ``refine`` makes;
    exact for hard and for noisy tables. Past ``MOST_STATES`` groups it answers by gain per
    cost instead.
    """

    def __init__(
        self,
        table: FaultFeatureTable,
        strategy: str = "optimal",
        drop_below: float = DROP_BELOW,
    ) -> None:
        if strategy not in STRATEGIES:
            raise ConfigurationError(
                f"strategy {strategy!r} is unknown, choose one of {', '.join(STRATEGIES)}"
            )
        self.table = table
        self.strategy = strategy
        self.drop_below = drop_below
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
        question = self._question(normalised(group), computed, at_hand)
        if self.strategy != "optimal":
            return GREEDY[self.strategy](question)
        try:
            return self._optimum(question.group, question.prices, len(self._memory))[1]
        except _TooManyStatesError:
            return _information(question)

    def _question(
        self, group: Group, computed: Collection[str], at_hand: Collection[str]
    ) -> _Question:
        costs = {
            feature: 0.0 if feature in at_hand else self.table.costs[feature]
            for feature in self.table.features
            if feature not in computed
        }
        prices = dict(sorted(costs.items(), key=lambda item: (item[1], item[0])))
        return _Question(group, self.table, prices, self.drop_below)

    def _optimum(
        self, group: Group, prices: Mapping[str, float], known: int
    ) -> tuple[float, str | None]:
        """Expected cost to the leaves and the first feature on the way, memoised."""
        if len(group) < 2:
            return 0.0, None
        key = (tuple((fault, round(p, 9)) for fault, p in group.items()), tuple(prices.items()))
        if key not in self._memory:
            if len(self._memory) - known >= MOST_STATES:
                raise _TooManyStatesError
            self._memory[key] = self._cheapest(group, prices, known)
        return self._memory[key]

    def _cheapest(
        self, group: Group, prices: Mapping[str, float], known: int
    ) -> tuple[float, str | None]:
        question = _Question(group, self.table, prices, self.drop_below)
        best, choice = math.inf, None
        for feature in question.splitting():
            if prices[feature] >= best:
                break  # cheapest first: the rest cost more than all of the best way
            left = {f: price for f, price in prices.items() if f != feature}
            total = prices[feature]
            for p, smaller in question.outcomes(feature).values():
                total += p * self._optimum(smaller, left, known)[0]
                if total >= best:
                    break
            if total < best:
                best, choice = total, feature
        return (best, choice) if choice else (0.0, None)


def next_feature(
    group: Group,
    table: FaultFeatureTable,
    computed: Collection[str] = (),
    strategy: str = "optimal",
    *,
    at_hand: Collection[str] = (),
    drop_below: float = DROP_BELOW,
) -> str | None:
    """Choose one feature, without a chooser to keep: see `FeatureChooser.next`."""
    return FeatureChooser(table, strategy, drop_below).next(group, computed, at_hand)
