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

"""Output of the isolator: verdicts that changed, repeated verdicts, feature requests."""

from __future__ import annotations

from dataclasses import replace

from flea_diag.stages.isolator.episode_lifecycle import EpisodeLifecycle
from flea_diag.stages.isolator.feature_requests import FeatureRequests
from flea_diag.stages.isolator.motion_history import MotionHistory
from flea_diag.stages.isolator.stand_status import StandStatus
from flea_diag.stages.isolator.verdict_record import VerdictRecord
from flea_diag.wire.records import NEVER_NS, AmbiguityGroup, FeatureValue, Record

Records = tuple[Record, ...]


class IsolatorOutput:
    """Makes the records of the isolator and keeps the last verdict."""

    def __init__(
        self,
        stand: StandStatus,
        motion: MotionHistory,
        episodes: EpisodeLifecycle,
        requests: FeatureRequests,
        verdict: VerdictRecord,
    ) -> None:
        self._stand = stand
        self._motion = motion
        self._episodes = episodes
        self._requests = requests
        self._verdict = verdict
        self._said: tuple[object, ...] = ()
        self._last: AmbiguityGroup | None = None

    def forget(self) -> None:
        """Publish the next verdict even if it equals the last one."""
        self._said = ()

    def say(self, stamp_ns: int) -> Records:
        """The ambiguity group, if it or its outcome has changed."""
        episode = self._episodes.current
        if episode is not None:
            self._requests.give_up(stamp_ns, episode)
        outcome, _ = self._verdict.outcome(stamp_ns, self._stand, episode)
        number = episode.shared.number if episode is not None else 0
        names = episode.said() if episode is not None else ()
        recurs = episode.recurrence if episode is not None else None
        stand = self._stand
        # An episode says by its evidence what it rests on.
        unjudged = stand.unjudged.names if episode is None else ()
        conditions = (
            stand.contact, stand.mode, stand.run, stand.outside, stand.beyond, stand.accepted,
        )  # fmt: skip
        wiring = stand.wiring and (stand.wiring.quality, stand.wiring.reason)
        unit = self._verdict.unit(stand) if episode is None else None
        state = (outcome, number, names, recurs, stand.bad, *conditions, unjudged, unit, wiring)
        if state == self._said:
            return ()
        if episode is not None and self._said[:1] and self._said[1] == number:
            episode.step += 1
        self._said = state
        self._last = self._verdict.record(stamp_ns, self._stand, episode)
        return (self._last,)

    def say_with_quality(self, stamp_ns: int) -> Records:
        """``say``, or the last verdict again if only offsets or counters have changed.

        Screens show them, and a restarted observer resumes from them.
        """
        if self._stand.first_ns == NEVER_NS and self._last is None:
            return ()  # latched before the first scan: an open episode follows
        said, last = self.say(stamp_ns), self._last
        kept = self._stand.offsets, self._stand.counters
        if said or last is None or kept == (last.offsets, last.counters):
            return said
        self._last = replace(last, offsets=self._stand.offsets, counters=self._stand.counters)
        return (self._last,)

    def ask(self, stamp_ns: int) -> Records:
        """A request, where the stand has vibration and a feature can split the group."""
        episode = self._episodes.current
        # Features were learned on windows throughout which the fault is there.
        recurs = episode is not None and episode.recurrence is not None
        if episode is None or recurs or not self._stand.axes or self._stand.wired_wrong:
            return ()
        return self._requests.ask(stamp_ns, episode, self._motion.window)

    def go_on(self, stamp_ns: int) -> Records:
        """Verdict and request. The request is made first: a group that waits is not final."""
        asked = self.ask(stamp_ns)
        return *self.say(stamp_ns), *asked

    def take(self, answer: FeatureValue) -> Records:
        """Records caused by the answer to a request."""
        episode = self._episodes.current
        if episode is None or not self._requests.take(answer, episode):
            return ()
        return self.go_on(answer.stamp_ns)
