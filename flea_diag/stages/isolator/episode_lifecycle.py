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

"""Lifecycle of the isolator's episodes: opened, joined with the observer's, closed.

What weighs their hypotheses is a ``Method``.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from enum import Enum, auto
from typing import Protocol

from flea_diag.core.choice.fault_group import refine_side
from flea_diag.core.choice.feature_table import FaultFeatureTable
from flea_diag.core.vibration.vibration_monitor import VibrationAlarm
from flea_diag.stages.episode import Episode
from flea_diag.stages.isolator.fault_episode import FaultEpisode
from flea_diag.stages.isolator.parameters import IsolatorParameters, Knowledge
from flea_diag.stages.isolator.stand_status import StandStatus
from flea_diag.stages.isolator.verdict_record import VerdictRecord
from flea_diag.stages.merge import Merge
from flea_diag.stages.recurrence.recurrence_watch import ComesAndGoes
from flea_diag.wire.blocks import ResidualBlock
from flea_diag.wire.records import (
    ANOTHER_UNIT,
    QUIET,
    TAKEN_BACK,
    TAKEN_OVER,
    AmbiguityGroup,
    Detection,
    Residual,
    Symbols,
)

RECURRENCE = "bursts that one fault explains each time"
"""What opens an episode of a fault that comes and goes."""


class Change(Enum):
    """Effect of a detection."""

    NOTHING = auto()
    OPENED = auto()
    TAKEN_OVER = auto()
    CLOSED = auto()
    ANOTHER_UNIT = auto()
    TAKEN_BACK = auto()


class Method(Protocol):
    """Makes episodes, and what differs from method to method."""

    def begin(self, shared: Episode) -> FaultEpisode:
        """A new episode."""

    def forget(self) -> None:
        """The unit was exchanged for another one."""

    def verdict(self) -> VerdictRecord:
        """What makes the verdict of an episode."""

    def pass_by(self, record: Residual, quiet: bool) -> None:
        """Take a scan that is evaluated in no episode; ``quiet``: none is open."""

    def learn(self, block: ResidualBlock) -> None:
        """Take scans while no episode is open."""

    def looks(self, episode: FaultEpisode, block: ResidualBlock) -> Iterator[int]:
        """Take scans of an open episode: yields each after which it is to be evaluated."""

    def evaluate(self, stamp_ns: int, episode: FaultEpisode) -> bool:
        """Compare the evidence of an episode with its hypotheses; whether there is any."""


MethodOf = Callable[[Knowledge, IsolatorParameters, StandStatus], Method]


class EpisodeLifecycle:
    """Opens and closes episodes, numbered from 1.

    Parameters
    ----------
    merge : held for the answers of an episode; released when it closes

    Attributes
    ----------
    current
        The open episode, or None.
    """

    def __init__(
        self,
        features: FaultFeatureTable,
        method: Method,
        merge: Merge,
    ) -> None:
        self._features = features
        self._method = method
        self._merge = merge
        self._opened = 0
        self._detection_number = 0
        self._early: Symbols | None = None
        self.current: FaultEpisode | None = None

    def take(self, detection: Detection) -> Change:
        """Open, join or close an episode according to a detection."""
        self._detection_number = detection.episode
        if self.current is not None and self.current.shared.vibrated_before(detection):
            self.close()
        episode = self.current
        if detection.detected and episode is None:
            self._open(Episode.of(detection, self._opened + 1))
            return Change.OPENED
        if detection.test == TAKEN_OVER and episode is not None:
            episode.take_over()
            return Change.TAKEN_OVER
        if detection.detected and episode is not None and episode.shared.opened_by_vibration:
            episode.join(detection)
        if detection.test in (QUIET, ANOTHER_UNIT) and episode is not None and episode.recurrence:
            # It comes again, and was ahead of all that stays: its watch says when it is over.
            return Change.NOTHING
        if detection.test == ANOTHER_UNIT:
            self._method.forget()
            self.close()
            return Change.ANOTHER_UNIT
        if detection.detected or episode is None:
            return Change.NOTHING
        if not detection.test.startswith(TAKEN_BACK):
            self.close()
            return Change.CLOSED
        if episode.shared.opened_by_vibration:
            return Change.NOTHING  # it has evidence of its own
        self.close()
        return Change.TAKEN_BACK

    def resume(self, verdict: AmbiguityGroup) -> None:
        """The open episode is that of this verdict: numbers go on, and the group only shrinks."""
        if self.current is not None:
            self._opened = verdict.episode
            self.current.resume(verdict)

    def early_symbols(self, detection: Detection) -> Symbols | None:
        """Symbols of this detection that arrived before it; returned once.

        Both are latched on topics of their own: either may arrive first.
        """
        early, self._early = self._early, None
        return early if early is not None and early.episode == detection.episode else None

    def of(self, symbols: Symbols) -> FaultEpisode | None:
        """The open episode, unless these symbols are of an earlier detection.

        Without an open episode they are kept for their detection. An isolator that starts late
        receives latched symbols of earlier episodes, too.
        """
        if self.current is None:
            self._early = symbols
        return None if symbols.episode < self._detection_number else self.current

    def open_by_vibration(self, stamp_ns: int, alarm: VibrationAlarm) -> FaultEpisode:
        """Open an episode of the faults that show in vibration, in place of the open one."""
        before = self.current.shared.opening_shift if self.current is not None else ""
        self.close()
        episode = self._open(
            Episode(
                self._opened + 1,
                stamp_ns,
                self._detection_number,
                alarm.words,
                before,
                opened_by_vibration=True,
            )
        )
        for hypothesis in episode.isolation.alive():
            if not hypothesis.fault.vibration:
                hypothesis.why_dropped = (
                    f"{alarm.axis} outside its nominal range; this fault has no vibration signature"
                )
        episode.settled = True
        episode.isolation.normalise()
        self._update_by_alarm(stamp_ns, episode, alarm)
        return episode

    def recur(self, stamp_ns: int, found: ComesAndGoes) -> None:
        """Faults come and go: the open episode is theirs, or a new one; without any it is over.

        One that vibration or the own test of a sensor opened has evidence of its own.
        """
        episode = self.current
        if episode is not None and (episode.shared.opened_by_vibration or episode.is_of_sensor):
            return
        if not found.fits:
            if episode is not None and episode.recurrence is not None:
                self.close()
            return
        if episode is None:
            shared = Episode(self._opened + 1, stamp_ns, self._detection_number, RECURRENCE)
            episode = self._open(shared)
        episode.recur(stamp_ns, found.fits, found.told)

    def _update_by_alarm(self, stamp_ns: int, episode: FaultEpisode, alarm: VibrationAlarm) -> None:
        """An alarm answers the feature of the same indicator and sensor: it is not requested."""
        left = refine_side(episode.group(), self._features, alarm.feature, alarm.side)
        episode.isolation.update(stamp_ns, alarm.feature, alarm.side, left)
        episode.query.pass_over(alarm.feature)

    def _open(self, shared: Episode) -> FaultEpisode:
        self._opened = shared.number
        self.current = self._method.begin(shared)
        return self.current

    def close(self) -> None:
        """Close the open episode, if any; no answer is awaited any more."""
        self.current = None
        self._merge.hold(None)
