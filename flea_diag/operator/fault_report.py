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

"""What a fault manager is told of a verdict: one code while it stands, with what it rests on."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass

from flea_diag.wire.records import (
    NEVER_NS,
    OUTCOME_LEVEL,
    AmbiguityGroup,
    Level,
    Outcome,
)

MOST_EVIDENCE, MOST_LETTERS, LONGEST_CODE = 32, 512, 64
"""Limits of ros2_medkit: pairs of evidence, bytes of a value, length of a code."""

FAILED, PASSED = 0, 1
"""Event types of ros2_medkit."""

SEVERITY: dict[Level, int] = {Level.WARN: 1, Level.ERROR: 2}
"""Level of the verdict -> severity of ros2_medkit."""

REPORTED = (
    Outcome.ISOLATED,
    Outcome.INDISTINGUISHABLE,
    Outcome.UNEXPLAINED,
    Outcome.MODEL_MISMATCH,
    Outcome.DATA_UNUSABLE,
)
"""Outcomes that are reported. A group that is still being split is not, and rest is no fault."""


@dataclass(frozen=True)
class FaultReport:
    """One report; a verdict that names one fault has its code, another the code of its outcome."""

    fault_code: str
    event_type: int
    severity: int
    description: str
    evidence: tuple[tuple[str, str], ...] = ()

    def passed(self) -> FaultReport:
        """The report that this fault is gone; it carries no evidence."""
        return FaultReport(self.fault_code, PASSED, self.severity, self.description)


def fault_report(group: AmbiguityGroup, stand: str) -> FaultReport | None:
    """Report of a verdict of the live stand; None where there is nothing to report.

    A fault manager keeps one fault a code, whoever reports it, so the code begins with the stand.
    """
    if group.source != "live" or group.outcome not in REPORTED:
        return None
    named = group.outcome is Outcome.ISOLATED and group.members
    return FaultReport(
        code(stand, group.members[0].fault if named else group.outcome.value),
        FAILED,
        SEVERITY[OUTCOME_LEVEL[group.outcome]],
        group.words,
        evidence(group),
    )


def code(stand: str, name: str) -> str:
    """A fault of a stand as a code: upper snake case, of at most 64 characters.

    Of a long name of the stand its end is kept, which tells it from those beside it.
    """
    fault = _snake(name)[:LONGEST_CODE]
    room = max(0, LONGEST_CODE - len(fault) - 1)
    return f"{_snake(stand)[-room:] if room else ''}_{fault}".strip("_")


def _snake(name: str) -> str:
    return re.sub(r"[^A-Z0-9]+", "_", name.upper()).strip("_")


def evidence(group: AmbiguityGroup) -> tuple[tuple[str, str], ...]:
    """Key/values of a report, the most probable faults first."""
    pairs = [("outcome", group.outcome.value), ("calibration_sha256", group.calibration_sha256)]
    if group.detected_stamp_ns != NEVER_NS:
        pairs.append(("detected_stamp_ns", str(group.detected_stamp_ns)))
    pairs.append(("members", ", ".join(member.fault for member in group.members)))
    for member in group.members:
        if not math.isnan(member.probability):
            pairs.append((f"probability/{member.fault}", repr(member.probability)))
        if not math.isnan(member.size):
            pairs.append((f"size/{member.fault}", f"{member.size!r} {member.size_unit}".rstrip()))
    return tuple((key, _cut(value)) for key, value in pairs if value)[:MOST_EVIDENCE]


def _cut(value: str) -> str:
    return value.encode()[:MOST_LETTERS].decode(errors="ignore")
