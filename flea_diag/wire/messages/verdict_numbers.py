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

"""A verdict as numbers in a message that any plot and any program reads without parsing text."""

from __future__ import annotations

import math
from collections.abc import Iterator

from flea_diag.wire.records import (
    NEVER_NS,
    OUTCOME_LEVEL,
    AmbiguityGroup,
    Candidate,
    Outcome,
    VerdictNumbers,
)

NUMBER_OF: dict[Outcome, int] = {
    Outcome.NOMINAL: 0,
    Outcome.DETECTED: 1,
    Outcome.ISOLATED: 2,
    Outcome.INDISTINGUISHABLE: 3,
    Outcome.UNEXPLAINED: 4,
    Outcome.NOT_OBSERVABLE: 5,
    Outcome.MODEL_MISMATCH: 6,
    Outcome.DATA_UNUSABLE: 7,
}
"""Outcome -> its number, which programs of others branch on: a new one is added at the end."""


def verdict_numbers(group: AmbiguityGroup) -> VerdictNumbers:
    """Numbers of a verdict, those of its members after those of the whole."""
    since_s = (group.stamp_ns - group.detected_stamp_ns) / 1e9
    told = {
        "outcome": NUMBER_OF[group.outcome],
        "level": OUTCOME_LEVEL[group.outcome],
        "stale": group.stale,
        "live": group.source == "live",
        "episode": group.episode,
        "step": group.step,
        "members": len(group.members),
        "dropped": max(len(group.dropped), group.dropped_count),
        "not_observable": max(len(group.not_observable), group.not_observable_count),
        "since_detection_s": math.nan if group.detected_stamp_ns == NEVER_NS else since_s,
        **{name: value for member in group.members for name, value in _of_member(member)},
    }
    return VerdictNumbers(group.stamp_ns, tuple(told), tuple(map(float, told.values())))


def _of_member(member: Candidate) -> Iterator[tuple[str, float]]:
    yield f"probability/{member.fault}", member.probability
    if not math.isnan(member.size):
        yield f"size/{member.fault}", member.size
        yield f"size_sigma/{member.fault}", member.size_sigma
