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

"""The temporal causal graph with the propagation paths of the possible faults highlighted."""

from __future__ import annotations

import itertools
from collections.abc import Iterable
from typing import Any

from flea_diag.operator.words import tr
from flea_diag.web.markup import Markup, tag, text
from flea_diag.wire.records import AmbiguityGroup

COLUMN, ROW = 122.0, 36.0
LEFT, TOP = 84.0, 24.0
LETTER = 6.4
ARROW = " -> "

Pair = tuple[str, str]


def lit(causal_map: Any, group: AmbiguityGroup) -> tuple[dict[Pair, int], set[str]]:
    """Edges on the path of a possible fault with the number of such faults, and the causes.

    Pairs of cause and residual are taken from the evidence that kept a fault; the path between
    the two is the shortest in the model.
    """
    edges: dict[Pair, int] = {}
    causes: set[str] = set()
    for candidate in group.members:
        own: dict[Pair, None] = {}
        for cause, residual in dict.fromkeys(_pairs(e.path for e in candidate.evidence)):
            nodes = causal_map.path(cause, residual)
            if nodes:
                causes.add(cause)
                own.update(dict.fromkeys(itertools.pairwise(nodes)))
        for pair in own:
            edges[pair] = edges.get(pair, 0) + 1
    return edges, causes


def _pairs(paths: Iterable[str]) -> Iterable[Pair]:
    """``a+, b- -> residual``: each cause with the residual at the end."""
    for words in paths:
        causes, _, end = words.rpartition(ARROW)
        for cause in causes.partition(ARROW)[0].split(", "):
            if cause:
                yield cause.rstrip("+-"), end.rstrip("+-")


def causal_paths(causal_map: Any, group: AmbiguityGroup | None) -> Markup:
    """SVG of the graph; without an episode no path is highlighted."""
    edges, causes = lit(causal_map, group) if group is not None else ({}, set())
    layout = causal_map.layout
    labels = {(e.source, e.target): e for e in causal_map.edges}
    touched = {name for pair in edges for name in pair}
    # Highlighted parts are drawn last, on top.
    routes = sorted(layout.routes.items(), key=lambda row: row[0] in edges)
    parts = [_edge(pair, route, labels.get(pair), edges.get(pair, 0)) for pair, route in routes]
    nodes = sorted(layout.places, key=lambda name: name in touched)
    parts += [_node(causal_map, name, name in touched, causes) for name in nodes]
    width = (layout.layers - 1) * COLUMN + 2 * LEFT
    return tag(
        "svg",
        tag("title", _words(group, edges)),
        _arrow_heads(),
        *parts,
        viewBox=f"0 0 {width:.0f} {layout.widest * ROW + 2 * TOP:.0f}",
        role="img",
        class_="tcg",
    )


def _words(group: AmbiguityGroup | None, edges: dict[Pair, int]) -> str:
    if group is None or not edges:
        return tr("Temporal causal graph; no path is active")
    faults = ", ".join(candidate.fault for candidate in group.members)
    return tr("Temporal causal graph; highlighted are the paths of {faults}", faults=faults)


def _at(place: tuple[int, float]) -> tuple[float, float]:
    return LEFT + place[0] * COLUMN, TOP + place[1] * ROW


def _arrow_heads() -> Markup:
    def head(name: str) -> Markup:
        return tag(
            "marker",
            tag("path", d="M0,0 L7,3.5 L0,7 Z", class_=name),
            id=name, viewBox="0 0 7 7", refX="7", refY="3.5", markerWidth="6", markerHeight="6",
            orient="auto",
        )  # fmt: skip

    return tag("defs", head("arrow"), head("arrow-lit"))


def _half(name: str) -> float:
    """Half the width of a node's box."""
    return len(name) * LETTER / 2 + 5


def _edge(pair: Pair, route: tuple[tuple[int, float], ...], edge: Any, count: int) -> Markup:
    points = [_at(place) for place in route]
    side = 1 if points[-1][0] >= points[0][0] else -1
    start = (points[0][0] + side * _half(pair[0]), points[0][1])
    end = (points[-1][0] - side * (_half(pair[1]) + 2), points[-1][1])
    if points[0][0] == points[-1][0]:  # in the same layer: around the right side
        end = (points[-1][0] + _half(pair[1]) + 2, points[-1][1])
    knots = [start, *points[1:-1], end]
    commands = f"M{start[0]:.0f},{start[1]:.0f}"
    for (x1, y1), (x2, y2) in itertools.pairwise(knots):
        bend = max(abs(x2 - x1) / 2, 18) * side
        back = -bend if points[0][0] == points[-1][0] else bend
        commands += f" C{x1 + bend:.0f},{y1:.0f} {x2 - back:.0f},{y2:.0f} {x2:.0f},{y2:.0f}"
    kind = "reads" if edge is None else "temporal" if edge.temporal else "instant"
    words = f"{edge.source} → {edge.target}  [{edge.label}]" if edge else tr("read by the residual")
    return tag(
        "path",
        tag("title", words),
        d=commands,
        class_=f"{kind} lit" if count else kind,
        stroke_width=f"{1.6 + min(count, 6) * 0.5:.1f}" if count else None,
        marker_end="url(#arrow-lit)" if count else "url(#arrow)",
    )


def _node(causal_map: Any, name: str, active: bool, causes: set[str]) -> Markup:
    x, y = _at(causal_map.layout.places[name])
    kind = (
        "residual"
        if name in causal_map.residuals
        else "channel"
        if name in causal_map.channels
        else "variable"
    )
    half = _half(name)
    box = {"x": f"{x - half:.0f}", "y": f"{y - 9:.0f}", "width": f"{2 * half:.0f}"}
    parameters = causal_map.parameters.get(name, ())
    marked = [p for p in parameters if p in causes]
    faulty = any(cause.startswith(f"{name}_") or cause == name for cause in causes)
    return tag(
        "g",
        tag("title", _told(kind, name, parameters)),
        tag("rect", **box, height=18, rx=4),
        text(x, y + 4, name, "", "middle"),
        text(x, y + 21, " ◆ ".join(["", *marked]).strip(), "cause", "middle") if marked else None,
        text(x - half - 8, y + 4, "◆", "cause", "middle") if faulty else None,
        class_=f"node {kind}{' lit' if active else ''}",
    )


def _told(kind: str, name: str, parameters: tuple[str, ...]) -> str:
    said = f"{tr(kind)} {name}"
    if not parameters:
        return said
    return tr("{what}, set by {parameters}", what=said, parameters=", ".join(parameters))
