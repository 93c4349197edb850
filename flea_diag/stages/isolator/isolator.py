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

"""Detection, Symbols and Residual in; AmbiguityGroup and FeatureRequest out.

One episode: the first deviation makes the hypotheses, later symbols and likelihoods drop
some, and while several are left the next best feature is asked for, one at a time, until one
is left or nothing can split them. Everything is decided by record stamps, in merged order.

This stage puts its inputs into that order and hands each to those who take it: scans to
``scan_isolation``, detections to ``episode_lifecycle``, answers to ``output``.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

from flea_diag.core.causal_graph.operating_point import QUADRANTS, Quadrant
from flea_diag.stages.isolator.episode_lifecycle import Change, EpisodeLifecycle, MethodOf
from flea_diag.stages.isolator.feature_requests import FeatureRequests
from flea_diag.stages.isolator.likelihood_method import LikelihoodMethod
from flea_diag.stages.isolator.motion_history import MotionHistory
from flea_diag.stages.isolator.output import IsolatorOutput, Records
from flea_diag.stages.isolator.parameters import IsolatorParameters, Knowledge
from flea_diag.stages.isolator.scan_isolation import ScanIsolation
from flea_diag.stages.isolator.stand_status import StandStatus, mismatch
from flea_diag.stages.isolator.vibration_watch import VibrationWatch
from flea_diag.stages.merge import Merge
from flea_diag.stages.recurrence.recurrence_watch import RecurrenceWatch
from flea_diag.wire.blocks import ResidualBlock
from flea_diag.wire.records import (
    NEVER_NS,
    STREAM,
    AmbiguityGroup,
    ChannelTable,
    DataQuality,
    Detection,
    FeatureValue,
    Quality,
    Record,
    Remark,
    Residual,
    Symbols,
    VibrationLevel,
)

__all__ = ["IsolatorParameters", "IsolatorStage", "Knowledge"]


class IsolatorStage:
    """See the module's first lines.

    ``in_process``: the observer's records come as they were caused, those of a scan before the
    residual of the next one. ``method`` weighs the hypotheses.
    """

    consumes: tuple[type, ...] = (
        ChannelTable,
        DataQuality,
        Residual,
        Detection,
        Symbols,
        VibrationLevel,
        FeatureValue,
        Remark,
        AmbiguityGroup,
    )

    def __init__(
        self,
        knowledge: Knowledge,
        parameters: IsolatorParameters,
        in_process: bool = False,
        method: MethodOf = LikelihoodMethod,
    ) -> None:
        self._in_process = in_process
        self._before: AmbiguityGroup | None = None
        """Last verdict of the isolator before this one."""
        self._calibration, self._residuals = knowledge.calibration, knowledge.effects.residuals
        parameters = parameters.covering(knowledge.calibration.coverage)
        self._gating, self._nominal = parameters.gating, knowledge.features.nominal
        self._merge = merge = Merge(
            Residual, round(parameters.watermark_s * 1e9), round(parameters.answer_limit_s * 1e9)
        )
        self._stand = stand = StandStatus(knowledge.calibration.counts, self._residuals)
        self._vibration = VibrationWatch(knowledge.features.nominal)
        self._motion = motion = MotionHistory(
            knowledge.calibration.parameters.encoder_m_per_rad,
            round(parameters.feature_window_s * 1e9),
            self._vibration.monitor,
            knowledge.effects,
            knowledge.calibration.counts,
        )
        made = method(knowledge, parameters, stand)
        self._episodes = EpisodeLifecycle(knowledge.features, made, merge)
        self._output = IsolatorOutput(
            stand,
            motion,
            self._episodes,
            FeatureRequests(knowledge, parameters, merge),
            made.verdict(),
        )
        self._recurrence = (
            RecurrenceWatch(knowledge.recurrence, parameters.drop_nats)
            if knowledge.recurrence is not None
            else None
        )
        self._scans = scans = ScanIsolation(
            parameters, made, stand, motion, self._vibration, self._recurrence, self._episodes,
            self._output,
        )  # fmt: skip
        self._take: dict[type, Callable[[Any], Records]] = {
            Residual: scans.step,
            ResidualBlock: scans.follow,
            Symbols: self._symbols,
            Detection: self._detection,
            FeatureValue: self._output.take,
            VibrationLevel: self._vibration_level,
            DataQuality: self._data_quality,
            ChannelTable: self._channel_table,
            Remark: self._decision,
        }

    def handle(self, record: Record) -> Records:
        """Records caused by one more input, once its turn in the merged order has come."""
        if isinstance(record, AmbiguityGroup):
            if self._stand.first_ns == NEVER_NS:
                self._before = record
            return ()
        if isinstance(record, Remark) and not record.kind.is_on_unit:
            return ()
        self._merge.push(record)
        return self._drain(everything=False)

    def handle_block(self, block: ResidualBlock) -> tuple[int, Records]:
        """Take all of these residuals."""
        self._merge.push_block(block)
        return len(block), self._drain(everything=False)

    @property
    def takes_blocks(self) -> bool:
        """Whether nothing waits that might change an episode, and no feature can be asked for."""
        return self._takes_blocks()

    def _takes_blocks(self) -> bool:
        alone = not self._vibration.waits and self._merge.clock_alone
        return alone and (self._episodes.current is None or not self._stand.axes)

    def finish(self) -> Records:
        """The input has ended: everything that still waits has its turn."""
        self._merge.hold(None)
        return self._drain(everything=True)

    def reset(self) -> Records:
        """Close the open episode, also one that vibration opened, and arm again."""
        if self._episodes.current is None:
            return ()
        self._episodes.close()
        self._vibration.monitor.clear()
        if self._recurrence is not None:
            self._recurrence.rearm()
        self._scans.turn()
        return self._output.say(self._merge.now_ns)

    def _drain(self, everything: bool) -> Records:
        out: list[Record] = []
        while (record := self._merge.pop(everything, self._takes_blocks)) is not None:
            kind = type(record)
            if kind is not Residual and kind is not ResidualBlock:
                self._scans.turn()
            out.extend(self._take[kind](record))
        return tuple(out)

    def _detection(self, record: Detection) -> Records:
        change = self._episodes.take(record)
        if change is Change.OPENED:
            return self._opened(record)
        if change is Change.NOTHING:
            return ()
        if change is Change.TAKEN_OVER:
            self._output.forget()
            return self._output.say(self._merge.now_ns)
        if change is Change.ANOTHER_UNIT:
            if self._recurrence is not None:
                self._recurrence.forget()
            self._stand.unit_ns = record.stamp_ns
            self._output.forget()
        if change is Change.TAKEN_BACK:
            self._stand.taken_back = record
        return self._output.say(record.stamp_ns)

    def _opened(self, record: Detection) -> Records:
        """The symbols of the same scan make the first group; mostly they come next."""
        if self._before is not None and self._goes_on(self._before, record):
            self._episodes.resume(self._before)
        symbols, episode = self._episodes.early_symbols(record), self._episodes.current
        if symbols is not None:
            return self._symbols(symbols)
        if episode is None or (episode.awaits_symbols and not episode.shared.taken_over):
            return ()
        return self._output.say(self._merge.now_ns if episode.awaits_symbols else record.stamp_ns)

    def _goes_on(self, verdict: AmbiguityGroup, opened: Detection) -> bool:
        """Whether the detection opened the episode of a verdict from before the first scan here."""
        first_ns = self._merge.now_ns if self._stand.first_ns == NEVER_NS else self._stand.first_ns
        past = first_ns == NEVER_NS or verdict.stamp_ns <= first_ns
        return past and verdict.episode > 0 and opened.stamp_ns <= verdict.stamp_ns

    def _symbols(self, record: Symbols) -> Records:
        episode = self._episodes.of(record)
        if episode is None:
            return ()
        episode.observe(record, self._visited())
        return self._output.say(record.stamp_ns)

    def _visited(self) -> Sequence[Quadrant]:
        """Quadrants in which symbols may have arisen: any, in a motion that was not watched."""
        if not self._gating or (self._stand.came_late and not self._motion.is_whole):
            return QUADRANTS
        visited = self._motion.quadrants()
        return [q for q in QUADRANTS if q in visited] or QUADRANTS

    def _data_quality(self, record: DataQuality) -> Records:
        if any(r.channel == STREAM and r.quality is Quality.STALE for r in record.channels):
            return ()  # a node's word that the source has stopped: no scan has told it
        if self._stand.take(record):
            self._output.forget()
        return self._output.say_with_quality(record.stamp_ns)

    def _vibration_level(self, record: VibrationLevel) -> Records:
        self._vibration.add(record)
        return ()

    def _decision(self, record: Remark) -> Records:
        self._stand.decision = record
        return self._output.say(record.stamp_ns)

    def _channel_table(self, record: ChannelTable) -> Records:
        unfit = mismatch(self._calibration, record, self._residuals)
        self._stand.take_table(record, unfit, self._nominal)
        # Of one process only vibration, which comes by a topic of its own, may be late.
        self._merge.in_step(self._in_process and not self._stand.axes)
        return ()
