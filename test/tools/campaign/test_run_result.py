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

"""A line of an evaluation reads back as it was, and its verdict follows the campaign's word."""

from __future__ import annotations

import json
from dataclasses import replace

import pytest

from flea_diag.errors import RecordingError
from flea_diag.tools.campaign.run_result import RunResult, from_mapping

JAM = RunResult(
    "a/1",
    "simulated",
    "Jam",
    truth="jam",
    onset_s=8.0,
    expected=("jam", "ball_nut_friction"),
    outcome="ISOLATED",
    group=("jam",),
    probabilities=(0.75,),
    detection_time_s=0.5,
    alarms_s=(8.5,),
)
QUIET = RunResult("a/2", "real", "Nominal", outcome="NOMINAL")


@pytest.mark.parametrize("result", [JAM, QUIET, replace(QUIET, failure="no scan")])
def test_a_line_reads_back(result: RunResult) -> None:
    line = result.to_line()
    assert "\n" not in line
    assert from_mapping(json.loads(line), "x") == result


def test_a_line_of_an_older_version_has_no_origin() -> None:
    content = json.loads(JAM.to_line())
    del content["date"], content["commit"]
    assert from_mapping(content, "x") == JAM
    named = replace(JAM, date="2026-11-22", commit="123456789")
    assert from_mapping(json.loads(named.to_line()), "x") == named


@pytest.mark.parametrize(
    ("result", "right"),
    [
        (JAM, True),
        (replace(JAM, group=("jam", "ball_nut_friction")), True),
        (replace(JAM, group=("ball_nut_friction",)), False),
        (replace(JAM, group=("jam", "motor_current_bias")), False),
        (replace(JAM, group=()), False),
        (replace(JAM, detection_time_s=None), False),
        (replace(JAM, false_alarms=1), False),
        (replace(JAM, failure="it crashed"), False),
        (QUIET, True),
        (replace(QUIET, alarms_s=(3.0,), outcome="ISOLATED"), False),
        (replace(QUIET, outcome="MODEL_MISMATCH"), False),
        (replace(QUIET, truth="spall", onset_s=0.0), True),
        (replace(QUIET, truth="jam", expected=("jam",)), False),
    ],
)
def test_what_is_right(result: RunResult, right: bool) -> None:
    assert result.right is right


@pytest.mark.parametrize(
    ("content", "words"),
    [
        ([], "run result must be a mapping"),
        ({"id": "a"}, "version"),
        ({"schema_version": 1, "id": "a", "kind": "real"}, "row is missing"),
        ({"schema_version": 1, "id": "a", "kind": "real", "row": "x", "colour": 1}, "'colour'"),
    ],
)
def test_another_line_is_refused(content: object, words: str) -> None:
    with pytest.raises(RecordingError, match=words):
        from_mapping(content, "results.jsonl: line 3")
