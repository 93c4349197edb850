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

"""What a fault manager is told: one code a verdict, within the limits of ros2_medkit."""

from __future__ import annotations

from dataclasses import replace

import pytest
import yaml
from support.places import ROOT
from support.verdicts import LAST, NOMINAL, group

from flea_diag.operator.fault_report import FaultReport, code, fault_report
from flea_diag.wire.records import Candidate, Outcome


def test_one_fault_has_its_own_code_and_a_group_that_of_its_outcome() -> None:
    one = fault_report(LAST, "bay_2")
    assert one is not None
    assert (one.fault_code, one.event_type, one.severity) == ("BAY_2_JAM", 0, 2)
    assert one.description == LAST.words
    several = fault_report(group(Outcome.INDISTINGUISHABLE, "jam", "spall"), "bay_2")
    assert several is not None
    assert (several.fault_code, several.severity) == ("BAY_2_INDISTINGUISHABLE", 2)
    assert dict(several.evidence)["members"] == "jam, spall"
    mismatch = fault_report(group(Outcome.MODEL_MISMATCH), "bay_2")
    assert mismatch is not None
    assert (mismatch.fault_code, mismatch.severity) == ("BAY_2_MODEL_MISMATCH", 1)


@pytest.mark.parametrize(
    "verdict",
    [
        NOMINAL,
        group(Outcome.NOT_OBSERVABLE),
        group(Outcome.DETECTED, "jam", "spall"),
        replace(LAST, source="replay"),
    ],
    ids=["nominal", "at rest", "still splitting", "replay"],
)
def test_what_is_no_standing_fault_of_the_live_stand_is_not_reported(verdict: object) -> None:
    assert fault_report(verdict, "bay_2") is None  # type: ignore[arg-type]


def test_evidence_holds_size_and_probability_within_the_limits() -> None:
    known = Candidate("jam", "friction+", 0.75, "fits", (), 120.5, 4.0, "N")
    others = tuple(Candidate(f"fault_{n}", "h", 0.01, "fits", (), 1.0, 0.1, "A") for n in range(60))
    report = fault_report(
        replace(group(Outcome.INDISTINGUISHABLE), members=(known, *others)), "bay_2"
    )
    assert report is not None
    found = dict(report.evidence)
    assert (found["probability/jam"], found["size/jam"]) == ("0.75", "120.5 N")
    assert len(report.evidence) == 32
    assert max(len(value.encode()) for value in found.values()) == 512


def test_a_fault_that_is_gone_has_passed_without_evidence() -> None:
    assert FaultReport("JAM", 0, 2, "words", (("a", "b"),)).passed() == FaultReport(
        "JAM", 1, 2, "words"
    )


@pytest.mark.parametrize(
    ("stand", "name", "expected"),
    [
        ("stand", "jam", "STAND_JAM"),
        ("hall_1/bay_2", "actuator_position_bias", "HALL_1_BAY_2_ACTUATOR_POSITION_BIAS"),
        ("a", "Motor: 2nd winding!", "A_MOTOR_2ND_WINDING"),
        ("a", "x" * 80, "X" * 64),
        ("left_arm_" * 10 + "elbow", "jam", ("LEFT_ARM_" * 10 + "ELBOW_JAM")[-64:]),
    ],
)
def test_codes_are_upper_snake_case_and_name_the_stand(
    stand: str, name: str, expected: str
) -> None:
    assert code(stand, name) == expected.strip("_")


def test_the_shipped_thresholds_confirm_and_heal_by_the_one_report_of_a_change() -> None:
    """The manager counts a failed report as -1 and a passed one as +1, up to its thresholds."""
    path = ROOT / "config" / "ros2_medkit_thresholds.yaml"
    (row,) = yaml.safe_load(path.read_text(encoding="utf-8")).values()
    failed = -1
    assert failed <= row["confirmation_threshold"] < 0
    assert row["healing_enabled"]
    assert failed + 1 >= row["healing_threshold"]
