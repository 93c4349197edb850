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

"""Layered layout of a directed graph, from causes to effects.

The method of Sugiyama, Tagawa and Toda (1981) in its simplest form. The layer of a node is the
length of the shortest path to it from a node without predecessors (longest paths would stretch a
graph with feedback). A long edge has a position in every layer it crosses. Each layer is ordered
by the mean position of its neighbours.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise

Pair = tuple[str, str]
Place = tuple[int, float]
"""Layer, and position within the layer."""

SWEEPS = 12  # assumption: by then no drawing of a shipped stand changes any more


@dataclass(frozen=True)
class Layout:
    """Positions of the nodes (``places``), and those each edge passes, ends included."""

    places: Mapping[str, Place]
    routes: Mapping[Pair, tuple[Place, ...]]
    layers: int
    widest: float


def layered(edges: Iterable[Pair], last: Iterable[str] = ()) -> Layout:
    """Layout of a graph; the nodes ``last`` are in a layer after all others."""
    pairs = tuple(dict.fromkeys(edges))
    layer = _layers(pairs)
    end = max(layer.values(), default=0)
    final = [name for name in last if name in layer]
    if final:
        end = max((layer[name] for name in layer if name not in final), default=0) + 1
        layer.update(dict.fromkeys(final, end))
    chains = {pair: _chain(pair, layer) for pair in pairs}
    rows = _rows(chains, layer, end + 1)
    links = [link for chain in chains.values() for link in pairwise(chain)]
    for sweep in range(SWEEPS):
        _sweep(rows, links, downward=sweep % 2 == 0)
    where = _spread(rows)
    return Layout(
        {name: where[name] for name in layer},
        {pair: tuple(where[knot] for knot in chain) for pair, chain in chains.items()},
        len(rows),
        max((place for _, place in where.values()), default=0.0),
    )


def _layers(pairs: Sequence[Pair]) -> dict[str, int]:
    """Length of the shortest path to each node; a closed cycle starts at any of its nodes."""
    after: dict[str, list[str]] = {name: [] for pair in pairs for name in pair}
    for source, target in pairs:
        after[source].append(target)
    targets = {target for _, target in pairs}
    layer = {name: 0 for name in after if name not in targets}
    queue = deque(layer)
    for start in (*layer, *after):
        if start not in layer:
            layer[start] = 0
            queue.append(start)
        while queue:
            node = queue.popleft()
            for target in after[node]:
                if target not in layer:
                    layer[target] = layer[node] + 1
                    queue.append(target)
    return layer


def _chain(pair: Pair, layer: Mapping[str, int]) -> tuple[str, ...]:
    """The ends of the edge, and one knot in each layer between them."""
    source, target = pair
    step = 1 if layer[target] >= layer[source] else -1
    between = range(layer[source] + step, layer[target], step)
    return (source, *(f"{source}>{target}@{k}" for k in between), target)


def _rows(
    chains: Mapping[Pair, tuple[str, ...]], layer: Mapping[str, int], count: int
) -> list[list[str]]:
    rows: list[dict[str, None]] = [{} for _ in range(count)]
    for chain in chains.values():
        for name in chain:
            rows[layer[name] if name in layer else int(name.rpartition("@")[2])][name] = None
    return [list(row) for row in rows]


def _sweep(rows: list[list[str]], links: Sequence[Pair], downward: bool) -> None:
    """Order each layer by the mean position of its neighbours in the layer before."""
    near: dict[str, list[str]] = {}
    for a, b in links:
        near.setdefault(a, []).append(b)
        near.setdefault(b, []).append(a)
    order = rows if downward else rows[::-1]
    for before, row in pairwise(order):
        place = {name: (k + 0.5) / len(before) for k, name in enumerate(before)}
        own = {name: (k + 0.5) / len(row) for k, name in enumerate(row)}

        wanted = {name: _mean(place, near.get(name, ()), own[name]) for name in row}
        row.sort(key=wanted.__getitem__)


def _mean(place: Mapping[str, float], names: Iterable[str], otherwise: float) -> float:
    known = [place[name] for name in names if name in place]
    return sum(known) / len(known) if known else otherwise


def _spread(rows: list[list[str]]) -> dict[str, Place]:
    """Centre every layer on the widest one."""
    widest = max((len(row) for row in rows), default=0)
    return {
        name: (k, (widest - len(row)) / 2 + at)
        for k, row in enumerate(rows)
        for at, name in enumerate(row)
    }
