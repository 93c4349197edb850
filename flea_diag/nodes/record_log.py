"""What a node decides, in its log: detections and verdicts once each, at the level of the verdict.

The log is for people who have no console open; ``/rosout`` carries it. ``--log-level
NODE:=debug`` adds why: symbols, features asked for and answered, each fault that is dropped.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from flea_diag.wire.bus import Bus
from flea_diag.wire.records import (
    AmbiguityGroup,
    DataQuality,
    Detection,
    FeatureRequest,
    FeatureValue,
    Level,
    Record,
    Symbols,
)
from flea_diag.wire.wording import Words, words_of

EXPLAINING: tuple[type, ...] = (Symbols, FeatureRequest, FeatureValue)
"""Records that explain a verdict: they are logged for debugging alone."""


class RecordLog:
    """Takes what a node publishes; each thing is said once, however often it is repeated."""

    def __init__(self, bus: Bus[Any]) -> None:
        self._bus = bus
        self._at_level: dict[Level, Callable[[str], None]] = {
            Level.OK: bus.info,
            Level.WARN: bus.caution,
            Level.ERROR: bus.error,
            Level.STALE: bus.caution,
        }
        self._verdict: tuple[Any, ...] = ()
        self._dropped: frozenset[tuple[str, str]] = frozenset()
        self._unsound: frozenset[tuple[str, str]] = frozenset()

    def add(self, record: Record) -> None:
        """Log what is new in a record."""
        if isinstance(record, AmbiguityGroup):
            self._group(record)
        elif isinstance(record, Detection):
            self._say(words_of(record))
        elif isinstance(record, DataQuality):
            self._quality(record)
        elif isinstance(record, EXPLAINING):
            self._bus.debug(_sentence(words_of(record)))

    def _group(self, group: AmbiguityGroup) -> None:
        """The verdict where outcome, episode or members have changed, and what was dropped."""
        dropped = frozenset((each.fault, each.reason) for each in group.dropped)
        for fault, reason in sorted(dropped - self._dropped):
            self._bus.debug(f"dropped {fault}: {reason}")
        self._dropped = dropped
        verdict = (group.outcome, group.episode, frozenset(m.fault for m in group.members))
        if verdict != self._verdict:
            self._verdict = verdict
            self._say(words_of(group), f"{group.outcome.value}: ")

    def _quality(self, quality: DataQuality) -> None:
        """Channels that have become unsound; throttled, for a loose plug says it often."""
        rows = [(row.channel, words_of(row, quality)) for row in quality.channels]
        unsound = frozenset((name, _sentence(w)) for name, w in rows if w.level is not Level.OK)
        news = sorted(unsound - self._unsound)
        self._unsound = unsound
        if news:
            self._bus.warn("; ".join(f"{channel} {words}" for channel, words in news))

    def _say(self, words: Words, before: str = "") -> None:
        self._at_level[words.level](before + _sentence(words))


def _sentence(words: Words) -> str:
    """The message without its level, which a log line has of its own."""
    return words.message.removeprefix(f"{words.level.name}: ")
