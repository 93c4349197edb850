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

"""A verdict of a baseline: members and words, no evidence, no course of an episode."""

from __future__ import annotations

from flea_diag.wire.records import NEVER_NS, AmbiguityGroup, Candidate, Outcome


def plain_verdict(
    stamp_ns: int,
    outcome: Outcome,
    words: str,
    members: tuple[Candidate, ...] = (),
    detected_ns: int = NEVER_NS,
    features: tuple[str, ...] = (),
) -> AmbiguityGroup:
    """Verdict of a replay; ``features`` are those that had to be computed for it."""
    return AmbiguityGroup(
        stamp_ns=stamp_ns,
        outcome=outcome,
        episode=1 if members else 0,
        step=0,
        seq=0,
        members=members,
        dropped=(),
        detected_stamp_ns=detected_ns,
        words=words,
        calibration_sha256="",
        source="replay",
        features_computed=features,
        features_available=len(features),
    )
