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

"""The diagnosis tree: features requested so far, branches taken, features planned next."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from flea_diag.operator.panel import share
from flea_diag.operator.words import tr
from flea_diag.web.history import answers, before_features
from flea_diag.web.markup import Markup, joined, tag
from flea_diag.wire.records import AmbiguityGroup

RAREST = 0.05
"""Branches with a lower probability are not drawn."""
MOST_NAMES = 5
DEEPEST = 3
"""Levels drawn below the last answer."""


def diagnosis_tree(planner: Callable[..., Any], group: AmbiguityGroup) -> Markup:
    """Nested list of the tree of an episode; empty where the stand has no features."""
    if not group.features_available or not group.members:
        return Markup()
    asked = [(sign.source, sign.observed) for sign in answers(group)]
    root = planner(before_features(group), asked=asked, rarest=RAREST)
    final = tuple(candidate.fault for candidate in group.members)
    return tag("ul", tag("li", _node(root, asked, final, 0)), class_="tree")


def _node(node: Any, asked: list[tuple[str, str]], final: tuple[str, ...], depth: int) -> Markup:
    """Draw a node; ``asked`` are the answers still to be followed from here."""
    if node.feature is None:
        return _leaf(node.faults if asked else final, taken=True)
    done = bool(asked)
    words = tr("computed") if done else tr("next") if depth == 0 else tr("then")
    head = joined(
        tag("span", words, class_="role"), " ", tag("b", node.feature), _cost(node.expected_cost)
    )
    if depth > DEEPEST:
        return joined(head, tag("span", " …"))
    return joined(head, tag("ul", *(_branch(b, asked, final, depth) for b in node.branches)))


def _cost(cost: float) -> Markup:
    return tag(
        "span", f" {cost:.3g}", class_="cost", title=tr("expected cost to the leaves, in ms")
    )


def _branch(
    branch: Any, asked: list[tuple[str, str]], final: tuple[str, ...], depth: int
) -> Markup:
    taken = bool(asked) and branch.symbol == asked[0][1]
    expected = share(branch.probability).strip()
    edge = tag(
        "span",
        f"{'✓ ' if taken else ''}{_symbol(branch.symbol)}",
        class_="edge",
        title=tr("observed value") if taken else tr("expected in {share}", share=expected),
    )
    if taken:
        inner = _node(branch.node, asked[1:], final, 0)
    elif asked:
        inner = _leaf(branch.node.faults, taken=False)
    else:
        inner = _planned(branch.node, depth + 1)
    return tag("li", edge, " ", inner, class_="taken" if taken else None)


def _planned(node: Any, depth: int) -> Markup:
    if node.feature is None:
        return _leaf(node.faults, taken=False)
    return _node(node, [], (), depth)


def _symbol(symbol: str) -> str:
    return tr("not computable") if symbol == "?" else symbol.replace("-", "−")


def _leaf(faults: tuple[str, ...], taken: bool) -> Markup:
    names = ", ".join(faults[:MOST_NAMES]) or tr("no fault of the group")
    if len(faults) > MOST_NAMES:
        names = tr("{faults} and {more} more", faults=names, more=len(faults) - MOST_NAMES)
    return tag("span", names, class_="leaf here" if taken else "leaf")
