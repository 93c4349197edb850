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

"""The diagnosis tree: groups of faults as nodes, answers as edges, rendered as text.

Built offline as a whole; its leaves are those that `FeatureChooser` reaches step by step
(Narasimhan et al. 2010, section 3.3).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

from flea_diag.core.choice.fault_group import Group, normalised, outcomes, refine
from flea_diag.core.choice.feature_choice import FeatureChooser
from flea_diag.core.choice.window_odds import WindowOdds


@dataclass(frozen=True)
class Branch:
    """One answer: its symbol, its probability at this node, and the remaining group."""

    symbol: str
    probability: float
    node: Node


@dataclass(frozen=True)
class Node:
    """A group and the feature to compute there; a leaf has no feature.

    ``expected_cost`` is the mean cost from here to the leaves.
    """

    group: tuple[tuple[str, float], ...]
    feature: str | None
    branches: tuple[Branch, ...]
    expected_cost: float

    @property
    def faults(self) -> tuple[str, ...]:
        """Faults of the group, the most probable first."""
        return tuple(fault for fault, _ in sorted(self.group, key=lambda row: (-row[1], row[0])))


def build(
    group: Group,
    chooser: FeatureChooser,
    computed: frozenset[str] = frozenset(),
    rarest: float = 0.0,
) -> Node:
    """Whole tree below a group.

    Omits answers that the chooser does not plan for, and those reached with a probability below
    ``rarest``.
    """
    group = normalised(group)
    feature = chooser.next(group, computed)
    members = tuple(group.items())
    if feature is None:
        return Node(members, None, (), 0.0)
    rules = chooser.rules
    found = outcomes(group, chooser.table, feature, rules.drop_below, rules.rarest)
    branches = tuple(
        Branch(symbol, p, build(left, chooser, computed | {feature}, rarest / p))
        for symbol, (p, left) in found.items()
        if p >= rarest
    )
    below = math.fsum(branch.probability * branch.node.expected_cost for branch in branches)
    return Node(members, feature, branches, chooser.table.costs[feature] + below)


def asked_tree(
    group: Group, chooser: FeatureChooser, asked: Sequence[tuple[str, str]], rarest: float = 0.0
) -> Node:
    """Tree along the features already requested, planned further from the last of them.

    ``asked``: features, each with its symbol. Branches not taken end with the group that they
    would have left; ``?`` (not computable) is a branch that leaves the group unchanged.
    """
    if not asked:
        return build(group, chooser, rarest=rarest)
    computed: frozenset[str] = frozenset()
    return _asked(normalised(group), chooser, tuple(asked), computed, rarest)


def _asked(
    group: dict[str, float],
    chooser: FeatureChooser,
    asked: tuple[tuple[str, str], ...],
    computed: frozenset[str],
    rarest: float,
) -> Node:
    if not asked:
        return build(group, chooser, computed, rarest)
    (feature, taken), rest = asked[0], asked[1:]
    rules = chooser.rules
    found = outcomes(group, chooser.table, feature, rules.drop_below, rules.rarest)
    if taken not in found:
        found = {**found, taken: (0.0, refine(group, chooser.table, feature, taken, 0.0))}
    branches = tuple(
        Branch(symbol, p, _asked(left, chooser, rest, computed | {feature}, rarest))
        if symbol == taken
        else Branch(symbol, p, Node(tuple(left.items()), None, (), 0.0))
        for symbol, (p, left) in found.items()
    )
    return Node(tuple(group.items()), feature, branches, chooser.table.costs[feature])


def follow(
    group: Group, chooser: FeatureChooser, answer: Callable[[str], str]
) -> tuple[dict[str, float], tuple[str, ...]]:
    """Walk from a group to a leaf by one window; ``answer`` gives the symbol of a feature.

    Returns the remaining group and the features requested. ``?`` (not computable) leaves the
    group unchanged, and the next best feature is requested.
    """
    left, odds, asked = normalised(group), WindowOdds(), list[str]()
    while (feature := chooser.next(odds.unbounded(left, chooser.table), asked)) is not None:
        asked.append(feature)
        left = odds.after(left, chooser.table, feature, answer(feature))
    return left, tuple(asked)


def leaves(node: Node) -> Iterator[Node]:
    """Leaves of a tree, left to right."""
    if not node.branches:
        yield node
    for branch in node.branches:
        yield from leaves(branch.node)


def render(node: Node) -> str:
    """Tree as text: features at the nodes, one edge per answer, groups at the leaves."""
    head = f"{words(node)}   expected cost {node.expected_cost:.4g}"
    return "\n".join([head, *_lines(node, "")])


def words(node: Node) -> str:
    """Label of a node: the feature to compute, or the remaining group."""
    if not node.group:
        return "no fault of the group fits"
    return f"{node.feature}?" if node.feature else "{" + ", ".join(node.faults) + "}"


def _lines(node: Node, indent: str) -> Iterator[str]:
    for branch in node.branches:
        last = branch is node.branches[-1]
        knot, rail = ("└─ ", "   ") if last else ("├─ ", "│  ")
        yield f"{indent}{knot}{branch.symbol} ({branch.probability:.0%})  {words(branch.node)}"
        yield from _lines(branch.node, indent + rail)
