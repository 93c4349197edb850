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
