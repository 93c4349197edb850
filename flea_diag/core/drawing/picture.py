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

"""Pictures of a bond graph and of its temporal causal graph, as Graphviz DOT text."""

from __future__ import annotations

from collections.abc import Mapping

from flea_diag.core.bond_graph.bond_graph import (
    DETECTORS,
    JUNCTIONS,
    SOURCES,
    Bond,
    BondGraph,
    Element,
)
from flea_diag.core.bond_graph.causality import Causality
from flea_diag.core.causal_graph.temporal_causal_graph import Edge, TemporalCausalGraph

_SHAPE = {
    **dict.fromkeys(JUNCTIONS, "box style=rounded"),
    **dict.fromkeys(SOURCES, "cds"),
    **dict.fromkeys(DETECTORS, "ellipse"),
}
WRONG = "red"


def bond_graph_dot(graph: BondGraph, causality: Causality) -> str:
    """Bond graph with half-arrows and causal strokes; conflicts are red.

    The half-arrow points in the direction of positive power. The bar (tee) is the causal stroke,
    at the end that receives the effort.
    """
    wrong = {c.node for c in causality.conflicts} | set(causality.derivative)
    # A loop consists of efforts and flows, named after their elements.
    looped = {variable[2:] for loop in causality.loops for variable in loop}
    wrong |= looped & set(graph.elements)
    lines = [f"digraph {quoted(graph.name)} {{", "  rankdir=LR; node [fontsize=10];"]
    lines += [_node(element, element.name in wrong) for element in graph.elements.values()]
    lines += [_bond(bond, causality.effort_from.get(bond.name, "")) for bond in graph.bonds]
    return "\n".join([*lines, "}", ""])


def _node(element: Element, wrong: bool) -> str:
    name = element.name.removesuffix("_sensor")
    label = f"{element.kind}: {name}"
    shape = _SHAPE.get(element.kind, "plaintext")
    color = f" color={WRONG} fontcolor={WRONG}" if wrong else ""
    return f'  {quoted(element.name)} [label="{label}" shape={shape}{color}];'


def _bond(bond: Bond, effort_from: str) -> str:
    head = "teelnormal" if effort_from == bond.tail else "lnormal"
    tail = "tee" if effort_from == bond.head else "none"
    return (
        f"  {quoted(bond.tail)} -> {quoted(bond.head)}"
        f" [dir=both arrowhead={head} arrowtail={tail}];"
    )


def causal_graph_dot(
    graph: TemporalCausalGraph, channels: frozenset[str], tokens: Mapping[str, str]
) -> str:
    """TCG: temporal edges dashed, channels boxed, parameters in italics."""
    lines = ["digraph tcg {", "  rankdir=LR; node [fontsize=10 shape=plaintext];"]
    lines += [f"  {quoted(c)} [shape=box];" for c in graph.vertices if c in channels]
    lines += [f"  {quoted(p)} [fontname=italic fontcolor=gray40];" for p in graph.of_parameter]
    lines += [_edge(edge, tokens) for edge in graph.edges]
    lines += [_edge(edge, tokens, " color=gray70") for edge in graph.parameter_edges]
    return "\n".join([*lines, "}", ""])


def _edge(edge: Edge, tokens: Mapping[str, str], extra: str = "") -> str:
    style = " style=dashed" if edge.temporal else ""
    label = quoted(edge.label(tokens))
    return f"  {quoted(edge.source)} -> {quoted(edge.target)} [label={label}{style}{extra}];"


def quoted(text: str) -> str:
    """A DOT string."""
    escaped = text.replace("\\", "\\\\").replace('"', '\\"')
    return f'"{escaped}"'
