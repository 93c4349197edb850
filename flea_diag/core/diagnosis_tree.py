"""The diagnosis tree: groups of faults as nodes, answers as edges, drawn as text.

Built whole, offline, it has the same leaves as `FeatureChooser` reaches one step at a time
(Narasimhan et al. 2010, section 3.3).
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

from flea_diag.core.feature_choice import FeatureChooser, Group, normalised, outcomes


@dataclass(frozen=True)
class Branch:
    """One answer: its symbol, its probability at this node, and what is left."""

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
    rarest: float = 1e-4,
) -> Node:
    """Whole tree below a group; answers less probable than ``rarest`` are not followed."""
    group = normalised(group)
    feature = chooser.next(group, computed)
    members = tuple(group.items())
    if feature is None:
        return Node(members, None, (), 0.0)
    branches = tuple(
        Branch(symbol, p, build(left, chooser, computed | {feature}, rarest / p))
        for symbol, (p, left) in outcomes(group, chooser.table, feature, chooser.drop_below).items()
        if p >= rarest
    )
    below = math.fsum(branch.probability * branch.node.expected_cost for branch in branches)
    return Node(members, feature, branches, chooser.table.costs[feature] + below)


def leaves(node: Node) -> Iterator[Node]:
    """Leaves of a tree, left to right."""
    if not node.branches:
        yield node
    for branch in node.branches:
        yield from leaves(branch.node)


def render(node: Node) -> str:
    """Tree as text: the feature at each node, an edge for each answer, groups at the leaves."""
    head = f"{_words(node)}   expected cost {node.expected_cost:.4g}"
    return "\n".join([head, *_lines(node, "")])


def _lines(node: Node, indent: str) -> Iterator[str]:
    for branch in node.branches:
        last = branch is node.branches[-1]
        knot, rail = ("└─ ", "   ") if last else ("├─ ", "│  ")
        yield f"{indent}{knot}{branch.symbol} ({branch.probability:.0%})  {_words(branch.node)}"
        yield from _lines(branch.node, indent + rail)


def _words(node: Node) -> str:
    if not node.group:
        return "no fault of the group fits"
    return f"{node.feature}?" if node.feature else "{" + ", ".join(node.faults) + "}"
