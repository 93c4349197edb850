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

"""Summary of a live run from the records of its bag: truth and diagnosis."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

from flea_diag.wire.records import (
    NEVER_NS,
    AmbiguityGroup,
    Detection,
    Outcome,
    Record,
    Scan,
    Truth,
)

LARGEST_GROUP = 3
NOMINAL_FAULT = "nominal"


@dataclass(frozen=True)
class RunSummary:
    """Times in seconds after the first scan; None for events that did not occur."""

    truth: str
    onset_s: float | None
    detected_s: float | None
    final_s: float | None
    outcome: Outcome | None
    members: tuple[str, ...]
    features_computed: tuple[str, ...]
    features_available: int
    scans: int

    @property
    def failures(self) -> tuple[str, ...]:
        """Reasons why the diagnosis counts as wrong; empty when it is correct."""
        if self.scans == 0:
            return ("no scan was recorded",)
        if self.outcome is None:
            return ("no verdict was recorded",)
        return self._false_alarms() if self.onset_s is None else self._misses(self.onset_s)

    def _false_alarms(self) -> tuple[str, ...]:
        if self.outcome is Outcome.NOMINAL and self.detected_s is None:
            return ()
        return ("a fault was reported on a healthy stand",)

    def _misses(self, onset_s: float) -> tuple[str, ...]:
        found = []
        if self.detected_s is None:
            found.append("the fault was not detected")
        elif self.detected_s < onset_s:
            found.append(f"detected {onset_s - self.detected_s:.2f} s before the onset")
        if self.truth not in self.members:
            found.append(f"the final group does not contain {self.truth}")
        if len(self.members) > LARGEST_GROUP:
            found.append(
                f"the final group has {len(self.members)} members, above the limit {LARGEST_GROUP}"
            )
        return tuple(found)


def summarise(records: Iterable[Record]) -> RunSummary:
    """Summary of one run from its records, in recorded order."""
    start_ns, scans = 0, 0
    truth: Truth | None = None
    detected_ns = NEVER_NS
    groups: list[AmbiguityGroup] = []
    for record in records:
        if isinstance(record, Scan):
            start_ns = start_ns or record.stamp_ns
            scans += 1
        elif isinstance(record, Truth):
            truth = record
        elif isinstance(record, Detection) and record.detected and detected_ns == NEVER_NS:
            detected_ns = record.stamp_ns
        elif isinstance(record, AmbiguityGroup):
            groups.append(record)

    def seconds(stamp_ns: int) -> float | None:
        return None if stamp_ns == NEVER_NS else (stamp_ns - start_ns) / 1e9

    last = groups[-1] if groups else None
    faulty = truth is not None and truth.fault not in ("", NOMINAL_FAULT)
    return RunSummary(
        truth=truth.fault if truth is not None and faulty else NOMINAL_FAULT,
        onset_s=seconds(truth.onset_ns) if truth is not None and faulty else None,
        detected_s=seconds(detected_ns),
        final_s=seconds(_since(groups)),
        outcome=last.outcome if last else None,
        members=_members(last) if last else (),
        features_computed=last.features_computed if last else (),
        features_available=last.features_available if last else 0,
        scans=scans,
    )


def as_text(summary: RunSummary, bag: str) -> str:
    """The summary as printed at the end of a run."""
    onset = "" if summary.onset_s is None else f" from {summary.onset_s:.2f} s"
    members = ", ".join(summary.members)
    outcome = summary.outcome.value if summary.outcome else "no verdict"
    computed = ", ".join(summary.features_computed)
    rows = [
        ("truth", f"{summary.truth}{onset}"),
        ("diagnosis", f"{outcome}{': ' if members else ''}{members}"),
        ("delay", _delay(summary)),
        (
            "features",
            f"{len(summary.features_computed)} computed of {summary.features_available} available"
            + (f" ({computed})" if computed else ""),
        ),
        ("bag", f"{bag} ({summary.scans} scans)"),
    ]
    failures = summary.failures
    rows.append(("result", "WRONG: " + "; ".join(failures) if failures else "correct"))
    return "\n".join(f"{name:12}{text}" for name, text in rows)


def _delay(summary: RunSummary) -> str:
    if summary.detected_s is None:
        return "nothing detected"
    if summary.onset_s is None:
        return f"detected at {summary.detected_s:.2f} s"
    text = f"detected {summary.detected_s - summary.onset_s:.2f} s after the onset"
    if summary.final_s is not None:
        text += f", final group after {summary.final_s - summary.onset_s:.2f} s"
    return text


def _members(group: AmbiguityGroup) -> tuple[str, ...]:
    return tuple(member.fault for member in group.members)


def _since(groups: list[AmbiguityGroup]) -> int:
    """Stamp from which the final verdict stood unchanged."""
    stamp_ns = NEVER_NS
    for group in reversed(groups):
        if (group.outcome, set(_members(group))) != (groups[-1].outcome, set(_members(groups[-1]))):
            break
        stamp_ns = group.stamp_ns
    return stamp_ns
