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

"""Machines that nobody has thought of, through all commands."""

from __future__ import annotations

from pathlib import Path

import pytest
from support.machines.commands import through_all


@pytest.mark.parametrize("seed", [101, 107, 117])
def test_all_commands_take_a_machine_or_refuse_it_in_the_same_line(
    seed: int, tmp_path: Path
) -> None:
    answers = through_all(seed, tmp_path)
    assert list(answers.wrong()) == []


def test_what_is_refused_is_refused_by_the_first_command(tmp_path: Path) -> None:
    refused = []
    for seed in range(300, 308):
        answers = through_all(seed, tmp_path / str(seed), recorded=False)
        assert list(answers.wrong()) == [], seed
        refused += [seed] if answers.status["equations"] else []
    assert 0 < len(refused) < 8
