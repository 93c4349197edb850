"""Detection, Symbols and Residual in; AmbiguityGroup and FeatureRequest out.

One episode: the first deviation makes the hypotheses, later symbols and likelihoods drop
some, and while several are left the next best feature is asked for, one at a time, until one
is left or nothing can split them. Everything is decided by record stamps, in merged order.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

import numpy as np

from flea_diag.core.causal_graph.operating_point import QUADRANTS
from flea_diag.core.choice.fault_group import refine, refine_side
from flea_diag.core.choice.feature_choice import FeatureChooser
from flea_diag.core.isolation.isolation import Isolation
from flea_diag.core.vibration.vibration_monitor import VibrationAlarm
from flea_diag.stages.isolator.episode import CONCLUSIVE_SAMPLES, Episode, cause, shifted
from flea_diag.stages.isolator.feature_query import Inquiry
from flea_diag.stages.isolator.motion import Motion
from flea_diag.stages.isolator.parameters import IsolatorParameters, Knowledge
from flea_diag.stages.isolator.quantitative_isolation import Weighing, due, weighings
from flea_diag.stages.isolator.stand_status import Standing
from flea_diag.stages.isolator.verdict import Verdict, mismatch
from flea_diag.stages.isolator.vibration_watch import VibrationWatch
from flea_diag.stages.merge import Merge
from flea_diag.wire.blocks import ResidualBlock, block_of
from flea_diag.wire.records import (
    ANOTHER_UNIT,
    NEVER_NS,
    TAKEN_OVER,
    AmbiguityGroup,
    ChannelTable,
    DataQuality,
    Detection,
    FeatureValue,
    Record,
    Residual,
    Symbols,
    VibrationLevel,
)

__all__ = ["IsolatorParameters", "IsolatorStage", "Knowledge"]


class IsolatorStage:
    """See the module's first lines."""

    consumes: tuple[type, ...] = (
        ChannelTable,
        DataQuality,
        Residual,
        Detection,
        Symbols,
        VibrationLevel,
        FeatureValue,
    )

    def __init__(self, knowledge: Knowledge, parameters: IsolatorParameters) -> None:
        self._k = knowledge
        self._p = parameters
        self._chooser = FeatureChooser(knowledge.features, parameters.strategy)
        self._merge = Merge(
            Residual, round(parameters.watermark_s * 1e9), round(parameters.answer_limit_s * 1e9)
        )
        self._weighing = Weighing(knowledge.calibration)
        self._verdict = Verdict(knowledge, parameters, self._weighing.models, self._weighing.names)
        self._onset_ns = round(parameters.onset_s * 1e9)
        self._standing = Standing()
        self._episodes = 0
        self._told = 0
        self._episode: Episode | None = None
        self._watch = VibrationWatch(knowledge.features.nominal)
        self._window_ns = round(parameters.feature_window_s * 1e9)
        lead = knowledge.calibration.parameters.encoder_m_per_rad
        self._motion = Motion(lead, self._window_ns, self._watch.monitor)
        self._said: tuple[object, ...] = ()
        self._last: AmbiguityGroup | None = None
        self._early: Symbols | None = None

    def handle(self, record: Record) -> tuple[Record, ...]:
        """Records caused by one more input, once its turn in the merged order has come."""
        self._merge.push(record)
        return self._drain(everything=False)

    def finish(self) -> tuple[Record, ...]:
        """The input has ended: everything that still waits has its turn."""
        self._merge.hold(None)
        return self._drain(everything=True)

    def reset(self) -> tuple[Record, ...]:
        """Close the open episode, also one that vibration opened, and arm again."""
        if self._episode is None:
            return ()
        self._episode = None
        self._watch.monitor.clear()
        self._merge.hold(None)
        return self._say(self._merge.now_ns)

    @property
    def takes_blocks(self) -> bool:
        """Whether nothing waits that might change an episode, and no feature can be asked for."""
        alone = not self._watch.waits and self._merge.clock_alone
        return alone and (self._episode is None or not self._standing.axes)

    def handle_block(self, block: ResidualBlock) -> tuple[int, tuple[Record, ...]]:
        """Take all of these residuals."""
        self._merge.push_block(block)
        return len(block), self._drain(everything=False)

    def _drain(self, everything: bool) -> tuple[Record, ...]:
        out: list[Record] = []
        while (record := self._merge.pop(everything, not self.takes_blocks)) is not None:
            out.extend(self._take(record))
        return tuple(out)

    def _take(self, record: Record | ResidualBlock) -> Iterable[Record]:
        if isinstance(record, Residual):
            return self._residual(record)
        if isinstance(record, ResidualBlock):
            return self._residuals(record)
        if isinstance(record, Symbols):
            return self._symbols(record)
        if isinstance(record, Detection):
            return self._detection(record)
        if isinstance(record, FeatureValue):
            return self._feature(record)
        if isinstance(record, VibrationLevel):
            self._watch.add(record)
            return ()
        if isinstance(record, DataQuality):
            return self._data_quality(record)
        if isinstance(record, ChannelTable):
            self._standing.axes = tuple(
                row.name for row in record.channels if row.name.startswith("accelerometer")
            )
            self._standing.mismatch = mismatch(self._k.calibration, record)
            self._standing.table_ns = record.stamp_ns
        return ()

    # --- what arrives -----------------------------------------------------------------

    def _data_quality(self, record: DataQuality) -> Iterable[Record]:
        standing = self._standing
        if standing.take(record):
            self._said = ()
        if standing.first_ns == NEVER_NS and self._last is None:
            return ()  # older than what is to come: an open episode is told of next
        said, last = self._say(record.stamp_ns), self._last
        kept = standing.offsets, standing.counters
        if said or last is None or kept == (last.offsets, last.counters):
            return said
        # The same verdict once more: it is what people see, and an observer that comes back.
        self._last = replace(last, offsets=standing.offsets, counters=standing.counters)
        return (self._last,)

    def _detection(self, record: Detection) -> Iterable[Record]:
        self._told = record.episode
        if record.detected and self._episode is None:
            # The symbols of the same scan come next, and make the first group.
            episode = self._open(record.stamp_ns)
            episode.opened_by, episode.taken_over = cause(record), record.test == TAKEN_OVER
            episode.shifted = shifted(record)
            early, self._early = self._early, None
            if early is not None and early.episode == record.episode:
                return self._symbols(early)
            return self._say(self._merge.now_ns) if episode.taken_over else ()
        if record.test == TAKEN_OVER and self._episode is not None:
            self._episode.taken_over, self._said = True, ()
            return self._say(self._merge.now_ns)
        if record.detected and self._episode is not None and self._episode.heard:
            self._episode.shifted = shifted(record)
        if record.test == ANOTHER_UNIT:
            self._standing.unit_ns, self._said = record.stamp_ns, ()
            self._weighing.forget()
        elif record.detected or self._episode is None:
            return ()
        self._episode = None
        self._merge.hold(None)
        return self._say(record.stamp_ns)

    def _open(self, stamp_ns: int) -> Episode:
        self._episodes += 1
        isolation = Isolation(self._k.faults, self._k.signatures)
        inquiry = Inquiry(stamp_ns, self._window_ns, self._p.feature_windows)
        evidence = self._weighing.begin()
        self._episode = Episode(self._episodes, stamp_ns, isolation, evidence, inquiry)
        return self._episode

    def _symbols(self, record: Symbols) -> Iterable[Record]:
        episode = self._episode
        if episode is None:
            # Latched, as the detection is, on another topic: either may come first.
            self._early = record
            return ()
        if record.episode < self._told:
            return ()  # an isolator that starts late is told of earlier episodes, too
        visited = self._motion.quadrants()
        if not self._p.gating:
            visited = set(QUADRANTS)
        for symbol in record.symbols:
            seen = (symbol.residual, symbol.magnitude, symbol.slope)
            if seen not in episode.symbols and not episode.is_of_unit(symbol.residual):
                episode.symbols += (seen,)
                episode.isolation.observe(
                    record.stamp_ns,
                    *seen,
                    quadrants=[q for q in QUADRANTS if q in visited] or QUADRANTS,
                    settled=episode.settled,
                )
        return self._say(record.stamp_ns)

    def _residual(self, record: Residual) -> Iterable[Record]:
        moving = record.regressors[-1] > 0.5
        self._standing.step(record.stamp_ns, moving, bool(record.health and record.health[-1]))
        self._motion.step(record.stamp_ns, record.regressors, moving)
        raised = self._listen(record.stamp_ns)
        if self._episode is None:
            self._weighing.see(record)
        if self._episode is None or raised:
            return raised or self._say(record.stamp_ns)
        self._episode.learn(block_of(record), self._onset_ns)
        return self._weigh(record.stamp_ns, self._episode)

    def _residuals(self, block: ResidualBlock) -> Iterable[Record]:
        """Residuals between which nothing else comes."""
        out: list[Record] = []
        moving, lost = block.regressors[:, -1] > 0.5, np.any(block.health[:, -1:], axis=1)
        self._motion.follow(block)
        turns = self._standing.follow(block.stamps_ns, moving, lost, self._p.rest_s * 1e9)
        if self._episode is None:
            self._weighing.show(block)
            for row in turns:
                out.extend(self._say(int(block.stamps_ns[row])))
            return out
        for _ in turns:
            pass  # what an episode amounts to does not rest on it
        start = 0
        for end in weighings(self._episode, block.stamps_ns):
            self._episode.learn(block.part(slice(start, end)), self._onset_ns)
            out.extend(self._weigh(int(block.stamps_ns[end - 1]), self._episode))
            start = end
        self._episode.learn(block.part(slice(start, None)), self._onset_ns)
        return out

    def _weigh(self, stamp_ns: int, episode: Episode) -> Iterable[Record]:
        """Every half second of evidence: likelihoods, and whether the slow channels are done."""
        if not due(episode, stamp_ns):
            return self._ask(stamp_ns) if episode.inquiry.looks_out(stamp_ns) else ()
        if not episode.symbols and not episode.settled:
            return ()  # the observer's innovation detected; no relation has deviated yet
        if self._p.likelihood:
            self._weighing.weigh(stamp_ns, episode, self._p.drop_nats, self._p.gating)
        waited = (stamp_ns - episode.start_ns) / 1e9 >= self._p.settle_s
        if waited or episode.moving >= self._p.settle_samples:
            episode.settled = True
        if episode.symbols and (episode.settled or episode.scans >= CONCLUSIVE_SAMPLES):
            episode.isolation.require(
                stamp_ns, episode.magnitudes(), episode.moved_channels(), episode.settled
            )
        return self._go_on(stamp_ns)

    def _listen(self, stamp_ns: int) -> Iterable[Record]:
        """Vibration out of its nominal range opens an episode of its own."""
        alarm = self._watch.alarm(stamp_ns)
        if alarm is None or (self._episode is not None and not self._episode.gives_way):
            return ()
        before = self._episode.shifted if self._episode is not None else ""
        self._merge.hold(None)
        episode = self._open(stamp_ns)
        episode.opened_by, episode.heard, episode.shifted = alarm.words, True, before
        for hypothesis in episode.isolation.alive():
            if not hypothesis.fault.vibration:
                hypothesis.why_dropped = (
                    f"{alarm.axis} left its range, and this fault does not show in vibration"
                )
        episode.settled = True
        episode.isolation.normalise()
        self._update_by_alarm(stamp_ns, episode, alarm)
        return self._go_on(stamp_ns)

    def _update_by_alarm(self, stamp_ns: int, episode: Episode, alarm: VibrationAlarm) -> None:
        """That an indicator left its range is an answer already: to that feature of its sensor."""
        left = refine_side(episode.group(), self._k.features, alarm.feature, alarm.side)
        episode.isolation.update(stamp_ns, alarm.feature, alarm.side, left)
        episode.inquiry.pass_over(alarm.feature)

    # --- features ---------------------------------------------------------------------

    def _go_on(self, stamp_ns: int) -> Iterable[Record]:
        """Ask for what is to be asked first: a group that waits for an answer is not final."""
        asked = self._ask(stamp_ns)
        return [*self._say(stamp_ns), *asked]

    def _ask(self, stamp_ns: int) -> Iterable[Record]:
        """Request the next best feature, if one can split the group that is left."""
        episode = self._episode
        if episode is None or not episode.settled or not self._standing.axes:
            return ()
        inquiry = episode.inquiry
        if inquiry.request is not None:
            return ()
        inquiry.plan(episode.group(), self._chooser)
        if not inquiry.is_due(stamp_ns, self._motion.pace):
            return ()
        episode.step += 1
        self._merge.hold(stamp_ns + round(self._p.answer_budget_s * 1e9))
        return (inquiry.ask(stamp_ns, episode.number, episode.step),)

    def _feature(self, record: FeatureValue) -> Iterable[Record]:
        episode = self._episode
        if episode is None or not episode.inquiry.take(record):
            return ()
        self._merge.hold(None)
        if record.symbol != "?":
            left = refine(episode.group(), self._k.features, record.feature, record.symbol)
            episode.isolation.update(record.stamp_ns, record.feature, record.symbol, left)
        return self._go_on(record.stamp_ns)

    def _give_up(self, stamp_ns: int) -> None:
        """A feature whose answer never came is taken as not computable."""
        inquiry = self._episode.inquiry if self._episode is not None else None
        if inquiry is None or inquiry.request is None:
            return
        if stamp_ns - inquiry.request.stamp_ns > self._p.answer_limit_s * 1e9:
            inquiry.give_up()
            self._merge.hold(None)

    def _say(self, stamp_ns: int) -> tuple[Record, ...]:
        """The ambiguity group, if it or its outcome has changed."""
        self._give_up(stamp_ns)
        episode = self._episode
        outcome, _ = self._verdict.outcome(stamp_ns, self._standing, episode)
        number = episode.number if episode is not None else 0
        names = tuple(h.name for h in episode.isolation.alive()) if episode is not None else ()
        state = (outcome, number, names, self._standing.bad)
        if state == self._said:
            return ()
        if episode is not None and self._said[:1] and self._said[1] == number:
            episode.step += 1
        self._said = state
        self._last = self._verdict.record(stamp_ns, self._standing, episode)
        return (self._last,)
