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

"""Alarm of an episode: the detection, the verdict, and the operators' remarks.

An alarm is identified by the stamp of its detection, not by the number of its episode: numbers
restart with the isolator. It stays until it is acknowledged.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

from flea_diag.operator.words import later
from flea_diag.wire.records import (
    NEVER_NS,
    TAKEN_OVER,
    AmbiguityGroup,
    Detection,
    Outcome,
    RemarkKind,
    Symbol,
    Symbols,
)

REPLAY = "replay"
UNDO_NS = 10_000_000_000
"""Time for which an acknowledgement can be withdrawn."""

SHELVED, OUT = later("shelved"), later("out of service")

Key = tuple[str, int]
"""Source (live or replay) and stamp of the detection."""


@dataclass(frozen=True, slots=True)
class Comment:
    """Comment of an operator on an alarm, or on a moment (a mark)."""

    stamp_ns: int
    author: str
    text: str


@dataclass(frozen=True, slots=True)
class AlarmAction:
    """What somebody did to an alarm, or to all of a stand: who, when, why, and until when."""

    stamp_ns: int
    kind: RemarkKind
    author: str
    text: str
    until_ns: int = NEVER_NS


@dataclass(frozen=True, slots=True)
class Member:
    """One fault of the latest group of an alarm; ``size`` is NaN where none was estimated."""

    fault: str
    probability: float
    size: float
    size_sigma: float
    size_unit: str


@dataclass(frozen=True, slots=True)
class Alarm:
    """An episode from its detection to its acknowledgement.

    ``residual``, ``value``, ``limit`` and ``test`` are those of the detection. Without a detection
    record the residual is empty and ``opened_by`` comes from the verdict: the vibration monitor
    opens an episode without one, and a screen may have started later. ``deviations`` are the
    residuals that deviated during the episode: evidence, not alarms of their own. ``urgency`` is
    that of the catalogue. ``silenced`` (shelved, out of service) and ``undoable`` hold now.
    """

    source: str
    detected_ns: int
    episode: int
    residual: str = ""
    value: float = float("nan")
    limit: float = float("nan")
    test: str = ""
    outcome: Outcome = Outcome.DETECTED
    words: str = ""
    verdict_ns: int = NEVER_NS
    members: tuple[Member, ...] = ()
    deviations: tuple[Symbol, ...] = ()
    closed_ns: int = NEVER_NS
    acknowledged_ns: int = NEVER_NS
    acknowledged_by: str = ""
    comments: tuple[Comment, ...] = ()
    opened_by: str = ""
    urgency: str = ""
    actions: tuple[AlarmAction, ...] = ()
    silenced: str = ""
    undoable: bool = False

    @property
    def key(self) -> Key:
        """Identity of the alarm, also after a restart."""
        return self.source, self.detected_ns

    @property
    def standing(self) -> bool:
        """Whether it is not acknowledged yet."""
        return self.acknowledged_ns == NEVER_NS

    @property
    def rings(self) -> bool:
        """Whether the bell rings for it: not acknowledged, silenced, or of a replay."""
        return self.standing and self.source != REPLAY and not self.silenced


def of_detection(detection: Detection, source: str) -> Alarm:
    """Alarm opened by a detection."""
    return with_detection(Alarm(source, detection.stamp_ns, detection.episode), detection)


def of_group(group: AmbiguityGroup) -> Alarm:
    """Alarm of a verdict whose detection was not received."""
    return with_group(Alarm(group.source, group.detected_stamp_ns, group.episode), group)


def with_detection(alarm: Alarm, detection: Detection) -> Alarm:
    """Add value, limit and test of the detection that opened the episode."""
    if detection.test == TAKEN_OVER:
        return alarm
    return replace(
        alarm,
        residual=detection.residual,
        value=detection.z,
        limit=detection.threshold,
        test=detection.test,
    )


def with_group(alarm: Alarm, group: AmbiguityGroup) -> Alarm:
    """Update the verdict; a repeated verdict keeps the older stamp."""
    members = tuple(
        Member(c.fault, c.probability, c.size, c.size_sigma, c.size_unit) for c in group.members
    )
    same = (alarm.outcome, alarm.words) == (group.outcome, group.words)
    verdict_ns = alarm.verdict_ns if same and alarm.members else group.stamp_ns
    return replace(
        alarm,
        episode=group.episode,
        outcome=group.outcome,
        words=group.words,
        opened_by=group.opened_by or alarm.opened_by,
        urgency=dict(group.to_do).get("urgency", alarm.urgency),
        verdict_ns=verdict_ns,
        members=members,
        closed_ns=NEVER_NS,
    )


def with_symbols(alarm: Alarm, symbols: Symbols) -> Alarm:
    """Add deviations during the episode, each kind once with the time of its first occurrence."""
    seen = {(s.residual, s.magnitude, s.slope) for s in alarm.deviations}
    new = tuple(s for s in symbols.symbols if (s.residual, s.magnitude, s.slope) not in seen)
    return replace(alarm, deviations=alarm.deviations + new) if new else alarm


def bounded(alarms: Sequence[Alarm], most: int) -> tuple[Alarm, ...]:
    """The latest alarms; what nobody has acknowledged stays before the rest, its first above all.

    In a flood the first alarm is what the others may follow from, and the last what is true now.
    """
    if len(alarms) <= most:
        return tuple(alarms)
    waiting = [alarm for alarm in alarms if alarm.standing and alarm.source != REPLAY]
    kept = {alarm.key for alarm in (*waiting[:1], *waiting[1:][1 - most :])}
    rest = [alarm.key for alarm in alarms if alarm.key not in kept]
    kept.update(rest[len(rest) + len(kept) - most :])
    return tuple(alarm for alarm in alarms if alarm.key in kept)


def as_of(alarm: Alarm, service: AlarmAction | None, now_ns: int) -> Alarm:
    """The alarm at a moment of the wall clock: whether it is silenced, and what can be undone."""
    shelving = (RemarkKind.SHELVED, RemarkKind.UNSHELVED)
    last = next((a for a in reversed(alarm.actions) if a.kind in shelving), None)
    shelved = last is not None and last.kind is RemarkKind.SHELVED and last.until_ns > now_ns
    out = service is not None and service.kind is RemarkKind.OUT_OF_SERVICE
    silenced = SHELVED if shelved else OUT if out else ""
    undoable = 0 <= now_ns - alarm.acknowledged_ns < UNDO_NS and not alarm.standing
    if (silenced, undoable) == (alarm.silenced, alarm.undoable):
        return alarm
    return replace(alarm, silenced=silenced, undoable=undoable)
