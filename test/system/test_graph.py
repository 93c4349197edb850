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

from pathlib import Path

import pytest
from support.graph.judged import flown
from support.graph.spoilt_source import SPOILT
from support.graph.world import TROUBLES

SEEDS = range(100, 106)


@pytest.mark.parametrize("seed", SEEDS)
def test_nothing_wrong_is_said_and_nothing_is_lost(seed: int, tmp_path: Path) -> None:
    found = flown(seed, tmp_path / "graph")
    assert found.wrong == (), f"seed {seed}: {found.words}"


def test_a_seed_replays_exactly(tmp_path: Path) -> None:
    """The same messages at the same times; of another seed they are others."""
    first, again, other = (
        flown(seed, tmp_path / str(number)) for number, seed in enumerate((100, 100, 101))
    )
    assert first == again
    assert first.digest != other.digest


def test_what_can_go_wrong_has_a_name_of_its_own() -> None:
    assert not SPOILT.keys() & TROUBLES.keys()
