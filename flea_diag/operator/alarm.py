"""One episode as its alarm: what was measured, what it means, and what people said to it.

An alarm is known by when its episode was detected, not by the episode's number: numbers
start again with the isolator, the detection does not. It stays until it is acknowledged.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

from flea_diag.wire.records import (
    NEVER_NS,
    TAKEN_OVER,
    AmbiguityGroup,
    Detection,
    Outcome,
    Symbol,
    Symbols,
)

REPLAY = "replay"

Key = tuple[str, int]
"""Source (live or replay) and stamp of the detection."""


@dataclass(frozen=True, slots=True)
class Comment:
    """What somebody said to an alarm, or to a moment (a mark)."""

    stamp_ns: int
    author: str
    text: str


@dataclass(frozen=True, slots=True)
class Member:
    """One fault of an alarm's last group; ``size`` is NaN where none was estimated."""

    fault: str
    probability: float
    size: float
    size_sigma: float
    size_unit: str


@dataclass(frozen=True, slots=True)
class Alarm:
    """An episode from its detection to its acknowledgement.

    ``residual``, ``value``, ``limit`` and ``test`` are those of the detection; the residual is
    empty where no such record came (vibration opens an episode without one, and a screen may
    have been started later); ``opened_by`` is then what the verdict says of it. ``deviations``
    are the residuals that deviated in its course: evidence inside the episode, no alarms of
    their own.
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

    @property
    def key(self) -> Key:
        """What tells it from all others, also after a restart."""
        return self.source, self.detected_ns

    @property
    def standing(self) -> bool:
        """Whether it still waits for somebody to acknowledge it."""
        return self.acknowledged_ns == NEVER_NS

    @property
    def rings(self) -> bool:
        """Whether it may make a noise: not what is acknowledged, and never a replay."""
        return self.standing and self.source != REPLAY


def of_detection(detection: Detection, source: str) -> Alarm:
    """Alarm that a detection opens."""
    return with_detection(Alarm(source, detection.stamp_ns, detection.episode), detection)


def of_group(group: AmbiguityGroup) -> Alarm:
    """Alarm of a verdict whose detection was not seen."""
    return with_group(Alarm(group.source, group.detected_stamp_ns, group.episode), group)


def with_detection(alarm: Alarm, detection: Detection) -> Alarm:
    """Value, limit and test of the detection that opened it."""
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
    """The latest verdict on it; one that says the same again keeps the older stamp."""
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
        verdict_ns=verdict_ns,
        members=members,
        closed_ns=NEVER_NS,
    )


def with_symbols(alarm: Alarm, symbols: Symbols) -> Alarm:
    """Deviations in the course of the episode, the first of each kind with its time."""
    seen = {(s.residual, s.magnitude, s.slope) for s in alarm.deviations}
    new = tuple(s for s in symbols.symbols if (s.residual, s.magnitude, s.slope) not in seen)
    return replace(alarm, deviations=alarm.deviations + new) if new else alarm
