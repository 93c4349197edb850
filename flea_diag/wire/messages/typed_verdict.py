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

"""A verdict as the fields of ``flea_diag_msgs/msg/Verdict``, for workspaces that want types.

The package that is installed makes the message of them (``wire/bus/foreign_topic.py``).
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from flea_diag.wire.messages.verdict_numbers import NUMBER_OF
from flea_diag.wire.records import (
    OUTCOME_LEVEL,
    AmbiguityGroup,
    Candidate,
    Recurrence,
    TwoFaults,
)

VERDICT, TYPE = "verdict", "flea_diag_msgs/msg/Verdict"
SECOND_NS = 1_000_000_000


def typed_verdict(group: AmbiguityGroup) -> Mapping[str, Any]:
    """Fields of the message; of a summary without its hypotheses ``dropped`` is empty."""
    return {
        "header": {"stamp": _time(group.stamp_ns)},
        "outcome": NUMBER_OF[group.outcome],
        "level": int(OUTCOME_LEVEL[group.outcome]),
        "stale": group.stale,
        "live": group.source == "live",
        "episode": group.episode,
        "step": group.step,
        "detected": _time(group.detected_stamp_ns),
        "words": group.words,
        "calibration_sha256": group.calibration_sha256,
        "members": [_fault(member) for member in group.members],
        "dropped": [_fault(each) for each in group.dropped],
        "not_observable": [fault for fault, _ in group.not_observable],
        "looked_for": list(group.looked_for),
        "pairs": [_pair(pair) for pair in group.pairs],
        "comes_and_goes": [_recurrence(told) for told in group.comes_and_goes],
    }


def _pair(pair: TwoFaults) -> Mapping[str, Any]:
    return {"first": pair.first, "second": pair.second, "probability": pair.probability}


def _recurrence(told: Recurrence) -> Mapping[str, Any]:
    return {
        "count": told.count,
        "most": told.most,
        "first": _time(told.first_ns),
        "last": _time(told.last_ns),
        "present_s": told.present_s,
        "absent_s": told.absent_s,
        "unseen_s": told.unseen_s,
        "shortest_s": told.shortest_s,
        "every_s": told.every_s,
        "place": told.place,
        "place_unit": told.place_unit,
    }


def _time(stamp_ns: int) -> Mapping[str, int]:
    seconds, rest = divmod(max(stamp_ns, 0), SECOND_NS)  # never is 0
    return {"sec": seconds, "nanosec": rest}


def _fault(row: Candidate) -> Mapping[str, Any]:
    return {
        "fault": row.fault,
        "hypothesis": row.hypothesis,
        "probability": row.probability,
        "size": row.size,
        "size_sigma": row.size_sigma,
        "size_unit": row.size_unit,
        "reason": row.reason,
    }
