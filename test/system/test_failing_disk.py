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

"""The n-th operation on a disk fails, for every n: one line, and no half-written file."""

from __future__ import annotations

from pathlib import Path

import pytest
from support import in_turn
from support.disk.failing_commands import WRITING, failed, operations
from support.graph.recorder_alone import recorded

QUICK = [name for name, row in WRITING.items() if not row.slow]


@pytest.mark.parametrize("name", in_turn(QUICK, 2))
def test_a_command_leaves_what_was_there_or_all_that_it_writes(name: str, tmp_path: Path) -> None:
    """Of every operation: the disk is full with it, and with it alone."""
    count, whole = operations(name, tmp_path / "disk")
    found = [failed(name, number, tmp_path / "disk", whole) for number in range(1, count + 1)]
    assert all(each.operation != "none" for each in found)
    assert [each for each in found if each.wrong] == []


@pytest.mark.in_turn(2)
def test_a_recorder_ends_with_a_word_and_keeps_what_it_was_given(tmp_path: Path) -> None:
    count = recorded(0, _fresh(tmp_path, 0)).count
    assert count > 30
    found = [recorded(number, _fresh(tmp_path, number)) for number in range(1, count + 1)]
    assert [each.wrong for each in found] == [()] * count
    assert all(each.operation for each in found)


def _fresh(tmp_path: Path, number: int) -> Path:
    folder = tmp_path / str(number)
    folder.mkdir()
    return folder
