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
