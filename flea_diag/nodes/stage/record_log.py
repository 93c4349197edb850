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

"""Logs the decisions of a node: each detection and verdict once, at the level of the verdict.

For use without a console; also published on ``/rosout``. ``--log-level NODE:=debug`` adds the
reasons: symbols, features requested and answered, and each fault dropped.
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
from flea_diag.wire.wording import Words, sentence_of, words_of

EXPLAINING: tuple[type, ...] = (Symbols, FeatureRequest, FeatureValue)
"""Records that explain a verdict; logged at debug level only."""


class RecordLog:
    """Logs the records a node publishes; repeated content is logged once."""

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
            self._bus.debug(sentence_of(words_of(record)))

    def _group(self, group: AmbiguityGroup) -> None:
        """The verdict if outcome, episode or members have changed, and the faults dropped."""
        dropped = frozenset((each.fault, each.reason) for each in group.dropped)
        for fault, reason in sorted(dropped - self._dropped):
            self._bus.debug(f"dropped {fault}: {reason}")
        self._dropped = dropped
        verdict = (group.outcome, group.episode, frozenset(m.fault for m in group.members))
        if verdict != self._verdict:
            self._verdict = verdict
            self._say(words_of(group), f"{group.outcome.value}: ")

    def _quality(self, quality: DataQuality) -> None:
        """Channels that have become invalid; throttled, because a loose plug repeats them."""
        rows = [(row.channel, words_of(row, quality)) for row in quality.channels]
        unsound = frozenset((name, sentence_of(w)) for name, w in rows if w.level is not Level.OK)
        news = sorted(unsound - self._unsound)
        self._unsound = unsound
        if news:
            self._bus.warn("; ".join(f"{channel} {words}" for channel, words in news))

    def _say(self, words: Words, before: str = "") -> None:
        self._at_level[words.level](before + sentence_of(words))
