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

"""Recordings in drawn dialects: the same stand and verdict as from the plain one, or a true line.

A sample; bench/robustness/dialects.py draws thousands.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest
from support.foreign.dialect_verdicts import DialectVerdicts
from support.foreign.dialect_walk import Walked, walked_bag, walked_table


@pytest.mark.parametrize("seed", range(1, 8))
def test_a_table_in_any_dialect_gives_the_stand_of_the_plain_one(tmp_path: Path, seed: int) -> None:
    found = walked_table(tmp_path / "walk", seed)
    assert not found.wrong, f"{found.words}: {found.wrong}"


@pytest.mark.parametrize("seed", [3, 40])
def test_a_bag_of_any_habit_gives_the_stand_of_the_plain_one(tmp_path: Path, seed: int) -> None:
    found = walked_bag(tmp_path / "walk", seed)
    assert not found.wrong, f"{found.words}: {found.wrong}"


@pytest.fixture(scope="module")
def verdicts(tmp_path_factory: pytest.TempPathFactory) -> DialectVerdicts:
    return DialectVerdicts(tmp_path_factory.mktemp("stands"))


@pytest.mark.in_turn(2)
@pytest.mark.parametrize(("walk", "seed"), [(walked_table, 0), (walked_bag, 14)])
def test_the_verdict_is_that_of_the_plain_one(
    tmp_path: Path,
    verdicts: DialectVerdicts,
    walk: Callable[[Path, int, DialectVerdicts], Walked],
    seed: int,
) -> None:
    found = walk(tmp_path / "walk", seed, verdicts)
    assert not found.wrong, f"{found.words}: {found.wrong}"
