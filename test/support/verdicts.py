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

"""Verdicts of one episode, and the state that a screen folds from them."""

from __future__ import annotations

from dataclasses import replace

from flea_diag.operator.state import (
    OperatorState,
    fold,
)
from flea_diag.wire.records import (
    NEVER_NS,
    AmbiguityGroup,
    Candidate,
    Detection,
    Outcome,
    Record,
)

START = 1_700_000_000 * 10**9
MS = 10**6


def group(outcome: Outcome, *faults: str, **more: object) -> AmbiguityGroup:
    values: dict[str, object] = {
        "stamp_ns": START,
        "episode": 1 if faults else 0,
        "step": 0,
        "seq": 1,
        "dropped": (),
        "detected_stamp_ns": START if faults else NEVER_NS,
        "words": "words",
        "calibration_sha256": "",
        "source": "live",
        **more,
    }
    members = tuple(Candidate(fault, f"{fault}+", 1.0 / len(faults), "fits") for fault in faults)
    return AmbiguityGroup(outcome=outcome, members=members, **values)  # type: ignore[arg-type]


def shown(*records: Record, state: OperatorState | None = None) -> OperatorState:
    state = state or OperatorState()
    for record in records:
        state = fold(state, record, record.stamp_ns)
    return state


NOMINAL = group(Outcome.NOMINAL)
FLAG = Detection(START, 1, True, "parity_mechanical_dn", 6.5, 5.0, "mean of 50 samples")
FIRST = group(Outcome.DETECTED, "jam", "ball_nut_friction", "winding_short")
LAST = replace(
    group(Outcome.ISOLATED, "jam"),
    stamp_ns=START + 4000 * MS,
    step=3,
    dropped=(Candidate("winding_short", "", 0.0, "parity_electrical: it did not move"),),
)
