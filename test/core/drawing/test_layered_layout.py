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

"""Layers from causes to effects: what must hold of every layout, and graphs drawn by hand."""

from __future__ import annotations

from itertools import pairwise

from hypothesis import given
from hypothesis import strategies as st

from flea_diag.core.drawing.layered_layout import layered

NAMES = st.sampled_from("abcdefgh")


@given(st.lists(st.tuples(NAMES, NAMES).filter(lambda pair: pair[0] != pair[1]), min_size=1))
def test_no_two_share_a_place_and_edges_pass_every_layer(edges: list[tuple[str, str]]) -> None:
    found = layered(edges)
    passed = [place for route in found.routes.values() for place in route[1:-1]]
    taken = [*found.places.values(), *passed]
    assert len(set(taken)) == len(taken)
    for (source, target), route in found.routes.items():
        assert (route[0], route[-1]) == (found.places[source], found.places[target])
        if route[0][0] != route[-1][0]:
            assert all(abs(a[0] - b[0]) == 1 for a, b in pairwise(route))
    assert all(0 <= k < found.layers and 0 <= at <= found.widest for k, at in taken)


def test_a_node_stands_as_far_from_the_inputs_as_its_shortest_path() -> None:
    found = layered([("u", "a"), ("a", "b"), ("b", "c"), ("u", "c"), ("c", "a")], last=["r"])
    layer = {name: place[0] for name, place in found.places.items()}
    assert layer == {"u": 0, "a": 1, "c": 1, "b": 2}


def test_what_is_to_be_last_stands_behind_all_others() -> None:
    found = layered([("u", "a"), ("a", "b"), ("u", "r"), ("b", "s")], last=["r", "s"])
    assert {name for name, place in found.places.items() if place[0] == 3} == {"r", "s"}


def test_a_ladder_is_drawn_without_crossings() -> None:
    edges = [(f"{c}{k}", f"{c}{k + 1}") for c in "xyz" for k in range(4)]
    found = layered(edges)
    order = [sorted("xyz", key=lambda c: found.places[f"{c}{k}"][1]) for k in range(5)]
    assert all(row == order[0] for row in order)


def test_a_graph_that_is_one_circle_has_a_beginning_too() -> None:
    found = layered([("a", "b"), ("b", "c"), ("c", "a")])
    assert sorted(place[0] for place in found.places.values()) == [0, 1, 2]
