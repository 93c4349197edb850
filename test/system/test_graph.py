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

"""Whole graphs in one seeded scheduler: nothing wrong is said, nothing is lost, and it repeats."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache

import pytest
from support import in_turn
from support.graph.judged import Judged, flown
from support.graph.spoilt_source import SPOILT
from support.graph.world import TROUBLES

SEEDS = in_turn(range(100, 104), 2)
"""``bench/robustness/graph.py`` flies as many as one likes."""


@pytest.fixture(scope="module")
def flight(tmp_path_factory: pytest.TempPathFactory) -> Callable[[int], Judged]:
    """What became of the graph of a seed, flown once."""

    @cache
    def flight_of(seed: int) -> Judged:
        return flown(seed, tmp_path_factory.mktemp(f"seed_{seed}") / "graph")

    return flight_of


@pytest.mark.parametrize("seed", SEEDS)
def test_nothing_wrong_is_said_and_nothing_is_lost(
    seed: int, flight: Callable[[int], Judged]
) -> None:
    found = flight(seed)
    assert found.wrong == (), f"seed {seed}: {found.words}"


def test_a_seed_replays_exactly(
    flight: Callable[[int], Judged], tmp_path_factory: pytest.TempPathFactory
) -> None:
    """The same messages at the same times; of another seed they are others."""
    again = flown(SEEDS[0], tmp_path_factory.mktemp("again") / "graph")
    assert again == flight(SEEDS[0])
    assert again.digest != flight(SEEDS[1]).digest


def test_what_can_go_wrong_has_a_name_of_its_own() -> None:
    assert not SPOILT.keys() & TROUBLES.keys()
