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

"""Course of an episode, reconstructed from one verdict.

Every candidate contains the evidence that kept or dropped it, with stamps. A single
``AmbiguityGroup`` therefore holds the whole episode: a page that was opened late, or lost
messages, shows the same as one that was open from the start.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from flea_diag.wire.records import AmbiguityGroup, Candidate, Evidence


@dataclass(frozen=True)
class Drop:
    """Faults dropped by one piece of evidence."""

    stamp_ns: int
    source: str
    candidates: tuple[Candidate, ...]


@dataclass(frozen=True)
class Sign:
    """Symbol of a residual or a feature, with the time of its observation."""

    stamp_ns: int
    source: str
    observed: str


def drops(group: AmbiguityGroup) -> tuple[Drop, ...]:
    """Dropped faults by time and evidence, the earliest first."""
    found: dict[tuple[int, str], list[Candidate]] = {}
    for candidate in group.dropped:
        last = candidate.evidence[-1] if candidate.evidence else None
        stamp_ns = last.stamp_ns if last else group.detected_stamp_ns
        source = last.source if last else candidate.reason.partition(":")[0]
        found.setdefault((stamp_ns, source), []).append(candidate)
    return tuple(
        Drop(stamp_ns, source, tuple(candidates))
        for (stamp_ns, source), candidates in sorted(found.items(), key=lambda row: row[0])
    )


def signs(group: AmbiguityGroup) -> tuple[Sign, ...]:
    """Symbols of residuals in order of observation."""
    seen = {
        Sign(e.stamp_ns, e.source, e.observed)
        for e in _evidence(group)
        if is_symbol(e) and e.source not in group.features_computed
    }
    return tuple(sorted(seen, key=lambda sign: (sign.stamp_ns, sign.source, sign.observed)))


def answers(group: AmbiguityGroup) -> tuple[Sign, ...]:
    """Computed features in order, each with its symbol."""
    seen = {e.source: Sign(e.stamp_ns, e.source, e.observed) for e in _evidence(group)}
    return tuple(seen[name] for name in group.features_computed if name in seen)


def before_features(group: AmbiguityGroup) -> dict[str, float]:
    """Faults that were possible at the first feature request, with equal weights.

    The record does not contain the weights of that time.
    """
    asked = set(group.features_computed)
    if not asked:
        return {candidate.fault: candidate.probability for candidate in group.members}
    names = [candidate.fault for candidate in group.members]
    for drop in drops(group):
        if drop.source in asked:
            names += [candidate.fault for candidate in drop.candidates]
    return dict.fromkeys(names, 1.0 / max(len(names), 1))


def is_symbol(evidence: Evidence) -> bool:
    """Whether the observation is a symbol (magnitude and slope), not a number or a feature."""
    return len(evidence.observed) == 2 and not set(evidence.observed) - set("+-0?*")


def _evidence(group: AmbiguityGroup) -> Iterator[Evidence]:
    for candidate in (*group.members, *group.dropped):
        yield from candidate.evidence
