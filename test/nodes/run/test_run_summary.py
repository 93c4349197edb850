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

"""Whether a live run was right, from records."""

from __future__ import annotations

from flea_diag.nodes.run.run_summary import as_text, summarise
from flea_diag.wire.records import (
    NEVER_NS,
    AmbiguityGroup,
    Candidate,
    Detection,
    Outcome,
    Record,
    Scan,
    Truth,
)

START_NS = 1_700_000_000 * 10**9


def at(seconds: float) -> int:
    return START_NS + round(seconds * 1e9)


def scan(seconds: float) -> Scan:
    return Scan(at(seconds), ("motor_current",), (0.0,))


def group(seconds: float, outcome: Outcome, *faults: str) -> AmbiguityGroup:
    return AmbiguityGroup(
        at(seconds), outcome, 1, 0, 0,
        tuple(Candidate(fault, fault, 1.0, "") for fault in faults), (),
        NEVER_NS, "", "", "live", (), ("rms", "kurtosis"), 14,
    )  # fmt: skip


def detection(seconds: float) -> Detection:
    return Detection(at(seconds), 1, True, "motor_current", 9.0, 4.0, "z")


JAM = Truth(at(2.0), "jam", at(2.0))
HEALTHY = Truth(at(0.0), "nominal", NEVER_NS)
RIGHT: tuple[Record, ...] = (
    HEALTHY,
    scan(0.0),
    group(0.0, Outcome.NOMINAL),
    JAM,
    scan(2.4),
    detection(2.4),
    group(2.4, Outcome.DETECTED, "jam", "spall", "ball_nut_friction", "backlash"),
    group(3.5, Outcome.INDISTINGUISHABLE, "jam", "ball_nut_friction"),
    group(5.0, Outcome.INDISTINGUISHABLE, "jam", "ball_nut_friction"),
)


def test_a_right_diagnosis() -> None:
    summary = summarise(RIGHT)
    assert summary.failures == ()
    assert (summary.onset_s, summary.detected_s, summary.final_s) == (2.0, 2.4, 3.5)
    text = as_text(summary, "bags/runs/x")
    assert "jam from 2.00 s" in text
    assert "detected 0.40 s after the onset, final group after 1.50 s" in text
    assert "2 computed of 14 available (rms, kurtosis)" in text
    assert "bags/runs/x (2 scans)" in text
    assert text.endswith("result      correct")


def failures(*records: Record) -> str:
    return "; ".join(summarise(records).failures)


def test_every_way_to_be_wrong_is_named() -> None:
    assert "not detected" in failures(scan(0.0), JAM, group(5.0, Outcome.NOMINAL))
    early = (scan(0.0), detection(1.5), JAM, group(5.0, Outcome.ISOLATED, "jam"))
    assert failures(*early) == "detected 0.50 s before the onset"
    assert "does not contain jam" in failures(*RIGHT, group(6.0, Outcome.ISOLATED, "spall"))
    crowd = group(6.0, Outcome.DETECTED, "jam", "a", "b", "c")
    assert "4 members, above the limit 3" in failures(*RIGHT, crowd)
    assert failures(scan(0.0), JAM) == "no verdict was recorded"
    assert failures(JAM) == "no scan was recorded"


def test_a_healthy_stand_must_stay_nominal() -> None:
    assert failures(HEALTHY, scan(0.0), group(0.1, Outcome.NOMINAL)) == ""
    alarm = (HEALTHY, scan(0.0), detection(1.0), group(1.0, Outcome.ISOLATED, "jam"))
    assert "healthy" in failures(*alarm)
