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

"""The whole diagnosis on one simulated run, and what is said of many."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from flea_diag.configuration.stand import load_stand
from flea_diag.core.choice.classifier import Perceptron
from flea_diag.tools.features.classifier import write_classifier
from flea_diag.tools.features.study import Plan, Study, study
from flea_diag.tools.features.study_report import (
    WAYS,
    draw_study,
    study_report,
    thirds,
    write_study,
)


def test_a_dead_accelerometer_is_found_live_at_a_fraction_of_the_cost(tmp_path: Path) -> None:
    """A dead sensor is a fault that shows in no slow channel.

    The classifier here is worked on paper: a level of zero is a dead sensor.
    """
    network = tmp_path / "network.json"
    write_classifier(network, DEAD_OR_NOT)
    plan = Plan(("accelerometer_2_fault", "spall"), load_stand(), load_stand().features, network)
    (run,) = study(plan, [SEED_OF_DEAD], ["accelerometer_2_fault"])
    assert run.size == 0.0
    assert run.resolved
    assert run.told
    assert run.classified
    assert run.features
    assert 3.0 < run.moved_s < 14.0
    assert 0.0 < run.lazy_s < 0.25 * run.eager_s
    assert run.answer_ms < 150.0
    write_study(tmp_path / "s.json", [run])
    assert json.loads((tmp_path / "s.json").read_text())["runs"][0]["right"]["diagnosis"] is True


SEED_OF_DEAD = 4
DEAD_OR_NOT = Perceptron(
    ("accelerometer_2_std",), ("accelerometer_2_fault", "nominal"), np.array([2.0]), np.ones(1),
    ((np.array([[-20.0, 20.0]]), np.zeros(2)),), "worked on paper",
)  # fmt: skip


def made(size: float, group: tuple[str, ...]) -> Study:
    told = ("jam",) if size > 4 else ("spall",)
    called = "jam" if size > 1 else "nominal"
    return Study("jam", 1, size, size, group, ("f",), 3.0, 0.02, 1.0, told, called)


def test_report_and_picture_count_what_was_resolved(tmp_path: Path) -> None:
    runs = [made(float(k), ("jam",) if k > 2 else ("jam", "spall")) for k in range(1, 10)]
    assert [len(part) for part in thirds(runs)] == [3, 3, 3]
    text = study_report(runs).splitlines()
    assert text[0].split() == ["fault", "n", *WAYS, "kept", "features"]
    assert text[1].split()[:3] == ["jam", "9", "0.778"]
    assert text[1].split()[6::4][:2] == ["0.556", "0.889"]  # features alone, the classifier
    assert text[2].split()[:6] == ["size", "1", "to", "3", "3", "0.333"]
    moved = next(line.split() for line in text if line.startswith("  2 s in motion"))
    assert moved[4:6] == ["8", "0.875"]  # all but the one that moved for 1 s
    assert "lazy over always: 2.00% of CPU; slowest answer 3.0 ms" in text
    assert sum("jam, spall" in line for line in text) == 2
    assert "classifier: nominal" in text[-2]
    unclassified = study_report([replace(run, called="") for run in runs])
    assert "classifier" not in unclassified
    pytest.importorskip("matplotlib", reason="needs matplotlib")
    draw_study(tmp_path / "sizes.svg", runs)
    assert "<svg" in (tmp_path / "sizes.svg").read_text()
