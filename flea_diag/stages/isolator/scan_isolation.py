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

"""Takes each scan: to the status of the stand, and to the baseline or the open episode."""

from __future__ import annotations

import numpy as np

from flea_diag.stages.isolator.episode_lifecycle import EpisodeLifecycle, Method
from flea_diag.stages.isolator.fault_episode import FaultEpisode
from flea_diag.stages.isolator.motion_history import MotionHistory
from flea_diag.stages.isolator.output import IsolatorOutput, Records
from flea_diag.stages.isolator.parameters import IsolatorParameters
from flea_diag.stages.isolator.stand_status import StandStatus
from flea_diag.stages.isolator.vibration_watch import VibrationWatch
from flea_diag.stages.recurrence.recurrence_watch import ComesAndGoes, RecurrenceWatch
from flea_diag.wire.blocks import ResidualBlock, block_of
from flea_diag.wire.records import Record, Residual, UnitOffset


class ScanIsolation:
    """Takes residuals, one scan or many, with the same result."""

    def __init__(
        self,
        parameters: IsolatorParameters,
        method: Method,
        stand: StandStatus,
        motion: MotionHistory,
        vibration: VibrationWatch,
        recurrence: RecurrenceWatch | None,
        episodes: EpisodeLifecycle,
        output: IsolatorOutput,
    ) -> None:
        self._rest_ns = parameters.rest_s * 1e9
        self._method = method
        self._stand = stand
        self._motion = motion
        self._vibration = vibration
        self._recurrence = recurrence
        self._episodes = episodes
        self._output = output
        self._judged: tuple[bool, ...] = ()
        """What of the last quiet scan its verdict rests on; empty: something else has changed."""

    def turn(self) -> None:
        """A record of another kind has come: the next scan has a verdict."""
        self._judged = ()

    def step(self, record: Residual) -> Records:
        """Records caused by one scan."""
        caused = self._scan(record)
        found = self._watched(record)
        return caused if found is None else (*caused, *self._recur(record.stamp_ns, found))

    def follow(self, block: ResidualBlock) -> Records:
        """Records caused by many scans with no other record between them."""
        out: list[Record] = []
        begun = 0
        watch = self._recurrence
        for taken, found in () if watch is None else watch.take(block, *self._watched_under):
            out.extend(self._scans(block.part(slice(begun, taken))))
            out.extend(self._recur(int(block.stamps_ns[taken - 1]), found))
            begun = taken
        out.extend(self._scans(block.part(slice(begun, None))))
        return tuple(out)

    def _watched(self, record: Residual) -> ComesAndGoes | None:
        """What comes and goes, by one more scan."""
        watch = self._recurrence
        return None if watch is None else watch.step(record, *self._watched_under)

    @property
    def _watched_under(self) -> tuple[tuple[UnitOffset, ...], bool]:
        """Offsets of this unit, and whether it is in contact with a stop."""
        return self._stand.offsets, self._stand.contact is not None

    def _recur(self, stamp_ns: int, found: ComesAndGoes) -> Records:
        """A fault comes and goes, has come once more, or is over."""
        self.turn()
        self._episodes.recur(stamp_ns, found)
        return self._output.say(stamp_ns)

    def _scan(self, record: Residual) -> Records:
        """What one scan causes by itself."""
        moving = record.regressors[-1] > 0.5
        self._stand.step(record.stamp_ns, moving, bool(record.health and record.health[-1]))
        self._motion.step(record.stamp_ns, record.regressors, moving)
        raised = self._listen(record.stamp_ns)
        episode = self._episodes.current
        if episode is None or raised:
            self._method.pass_by(record, quiet=episode is None)
            return raised or self._quiet(record.stamp_ns)
        looks = self._method.looks(episode, block_of(record))
        if seen := [self._evaluated(record.stamp_ns, episode) for _ in looks]:
            return seen[0]
        looks_out = episode.query.looks_out(record.stamp_ns)
        return self._output.ask(record.stamp_ns) if looks_out else ()

    def _quiet(self, stamp_ns: int) -> Records:
        """The verdict without an episode, where it may be another one."""
        judged = self._stand.judged(stamp_ns, self._rest_ns)
        if judged == self._judged:
            return ()
        self._judged = judged
        return self._output.say(stamp_ns)

    def _scans(self, block: ResidualBlock) -> Records:
        """What many scans cause by themselves."""
        if not len(block):
            return ()
        moving, lost = block.regressors[:, -1] > 0.5, np.any(block.health[:, -1:], axis=1)
        self._motion.follow(block)
        turns = self._stand.follow(block.stamps_ns, moving, lost, self._rest_ns)
        episode = self._episodes.current
        out: list[Record] = []
        if episode is None:
            self._method.learn(block)
            for row in turns:
                out.extend(self._quiet(int(block.stamps_ns[row])))
            return tuple(out)
        for _ in turns:
            pass  # the outcome of an episode does not depend on it
        for row in self._method.looks(episode, block):
            out.extend(self._evaluated(int(block.stamps_ns[row]), episode))
        return tuple(out)

    def _evaluated(self, stamp_ns: int, episode: FaultEpisode) -> Records:
        """What the evidence says by now."""
        if not self._method.evaluate(stamp_ns, episode):
            return ()
        return self._output.go_on(stamp_ns)

    def _listen(self, stamp_ns: int) -> Records:
        """A vibration alarm opens an episode of its own."""
        alarm, episode = self._vibration.alarm(stamp_ns), self._episodes.current
        if alarm is None or (episode is not None and not episode.yields_to_vibration):
            return ()
        self.turn()
        self._episodes.open_by_vibration(stamp_ns, alarm)
        return self._output.go_on(stamp_ns)
