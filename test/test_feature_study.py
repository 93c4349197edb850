"""The whole diagnosis on one simulated run, and what is said of many."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from flea_diag.tools.feature_study import (
    Study,
    draw_study,
    study,
    study_report,
    thirds,
    write_study,
)


def test_a_dead_accelerometer_is_found_live_at_a_fraction_of_the_cost(tmp_path: Path) -> None:
    """A dead sensor is a fault that shows in no slow channel."""
    (run,) = study(["accelerometer_2_fault"], [SEED_OF_DEAD], "feature_table.yaml")
    assert run.size == 0.0
    assert run.resolved
    assert run.features
    assert 3.0 < run.moved_s < 14.0
    assert 0.0 < run.lazy_s < 0.25 * run.eager_s
    assert run.answer_ms < 150.0
    write_study(tmp_path / "s.json", [run])
    assert json.loads((tmp_path / "s.json").read_text())["runs"][0]["resolved"] is True


SEED_OF_DEAD = 4


def made(size: float, group: tuple[str, ...]) -> Study:
    return Study("jam", 1, size, size, group, ("f",), 3.0, 0.02, 1.0)


def test_report_and_picture_count_what_was_resolved(tmp_path: Path) -> None:
    runs = [made(float(k), ("jam",) if k > 2 else ("jam", "spall")) for k in range(1, 10)]
    assert [len(part) for part in thirds(runs)] == [3, 3, 3]
    text = study_report(runs).splitlines()
    assert text[1].split()[:3] == ["jam", "9", "0.778"]
    assert text[2].split()[:6] == ["size", "1", "to", "3", "3", "0.333"]
    moved = next(line.split() for line in text if "in motion" in line)
    assert moved[4:6] == ["8", "0.875"]  # all but the one that moved for 1 s
    assert "lazy over always: 2.00% of CPU; slowest answer 3.0 ms" in text
    assert sum("jam, spall" in line for line in text) == 2
    pytest.importorskip("matplotlib", reason="needs matplotlib")
    draw_study(tmp_path / "sizes.svg", runs)
    assert "<svg" in (tmp_path / "sizes.svg").read_text()
