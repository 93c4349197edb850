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

"""``flea coverage`` on two runs of the simulated stand, one of them healthy."""

from __future__ import annotations

import math
from pathlib import Path

import pytest
import yaml

from flea_diag.configuration.calibrations import load_calibration
from flea_diag.configuration.stand import load_stand
from flea_diag.tools.evaluate.coverage import LADDER, CoverageScore, covered, words
from flea_diag.tools.main import main

CAMPAIGN = {
    "schema_version": 1,
    "name": "two",
    "sources": [
        {
            "kind": "drawn",
            "seed": 31,
            "duration_s": 20.0,
            "earliest_onset_s": 10.0,
            "latest_onset_s": 11.0,
            "vibration": False,
            "rows": [
                {"title": "Nominal", "cases": 1},
                {"title": "Dead", "fault": "motor_current_dead", "cases": 1},
            ],
        }
    ],
}


def test_a_calibration_is_completed_by_the_scores_of_faulty_runs(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file, target = tmp_path / "two.yaml", tmp_path / "covered.yaml"
    file.write_text(yaml.safe_dump(CAMPAIGN))
    assert main(["coverage", str(file), "-o", str(target)]) == 0
    made, before = load_calibration(target), load_calibration(load_stand().calibration)
    assert made.coverage is not None
    assert made.coverage.campaign == "two"
    assert made.coverage.runs == 1
    assert set(made.coverage.nats) <= set(LADDER)
    assert made.parameters == before.parameters
    assert "1 runs with a group, 0 without an alarm" in capsys.readouterr().out
    assert main(["coverage", str(file), "-o", str(target)]) == 2
    assert "--force" in capsys.readouterr().err


def test_runs_without_an_alarm_have_no_group_and_lost_faults_are_named() -> None:
    found = [
        CoverageScore("jam", 1.5),
        CoverageScore("jam", math.inf),
        CoverageScore("jam", math.nan),
        CoverageScore("spall", 0.5),
    ]
    known = covered("mine", found)
    assert (known.nats, known.lost, known.missed) == ((0.5, 1.5), 1, 1)
    assert list(words(known, found)) == [
        "3 runs with a group, 1 without an alarm",
        "coverage 80%: not reached by any limit",
        "coverage 90%: not reached by any limit",
        "coverage 95%: not reached by any limit",
        "coverage 98%: not reached by any limit",
        "lost at any limit: jam, 1 of 3 runs",
    ]
