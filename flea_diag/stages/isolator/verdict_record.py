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

"""Builds the ambiguity group: outcome, candidates with their evidence, next tests, remarks."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import replace

import numpy as np

from flea_diag.core.faults.response import to_do
from flea_diag.core.isolation.detectability import (
    TOO_WIDE,
    UNDETECTABLE,
    shows_from,
    undetectable,
    unseen,
    unseen_by_limits,
    without_relation,
)
from flea_diag.core.likelihood.fault_models import FaultModel
from flea_diag.core.run_law.run_law import VisibleSize
from flea_diag.errors import shown
from flea_diag.stages.isolator.advice import Advice
from flea_diag.stages.isolator.fault_episode import FaultEpisode
from flea_diag.stages.isolator.outcome import NAMING, Decision, OutcomeRules
from flea_diag.stages.isolator.pairs.candidates import FittedSizes, candidates
from flea_diag.stages.isolator.pairs.masking import Masking
from flea_diag.stages.isolator.parameters import IsolatorParameters, Knowledge
from flea_diag.stages.isolator.stand_status import StandStatus
from flea_diag.stages.judgement.fault_tests import tests_of_faults
from flea_diag.stages.judgement.looked_for import LookedFor
from flea_diag.wire.records import (
    NEVER_NS,
    STREAM,
    AmbiguityGroup,
    ChannelQuality,
    NextTest,
    Outcome,
    TwoFaults,
)

LATE_S = 2.0
"""A later first scan than this after the start of the stand is remarked on."""
NO_RELATION = (
    "in no relation of these channels: 'flea stand check' names the sensor that would show it"
)
RESUMED = "; isolator restarted in this episode: its group goes on, the evidence begins anew"
NO_ACCELEROMETER = "shows only in vibration, and this stand has no accelerometer"


class VerdictRecord:
    """Builds the verdict of an open episode, or of a stand without one."""

    def __init__(
        self,
        knowledge: Knowledge,
        parameters: IsolatorParameters,
        models: Sequence[FaultModel],
        quantified: Collection[str],
        rules: OutcomeRules | None = None,
        by_law: Sequence[VisibleSize] = (),
        run_share: Sequence[float] = (),
    ) -> None:
        self._k = knowledge
        self._source = parameters.source
        self._models = tuple(models)
        self._sizes = FittedSizes(self._models, np.array(run_share))
        faults, calibration = knowledge.faults, knowledge.calibration
        self._without_relation = without_relation(faults, self._models, calibration)
        visible = by_law or (calibration.law.visible if calibration.law else ())
        self._undetectable = self._unseen(visible, bool(by_law))
        modelled = {model.fault for model in self._models}
        known = [row for row in visible if row.fault in modelled]
        self._shows_from = shows_from(known, bool(by_law))
        residuals = knowledge.effects.residuals
        self._tests = tests_of_faults(faults, self._models, calibration, residuals)
        self._looked_for = LookedFor(faults, self._tests, residuals)
        promise = knowledge.calibration.promise
        self._stated_per_hour = promise.stated_per_hour
        self._supported_per_hour = promise.supported_per_hour
        self._rules = rules or OutcomeRules(knowledge, parameters, self._models, quantified)
        self._masking = Masking(knowledge, self._models)
        self._advice = Advice(knowledge, parameters, self._models)

    def _unseen(self, visible: Sequence[VisibleSize], by_law: bool) -> tuple[tuple[str, str], ...]:
        """Faults that these sensors do not show, by the law or by the limits of every residual."""
        faults, symptoms = self._k.faults, self._k.effects.residuals.symptoms
        if by_law:
            return tuple(unseen(faults, visible, symptoms).items())
        silent = undetectable(faults, self._models, self._k.calibration, symptoms)
        blind = (n for n in unseen_by_limits(visible) if n in faults and n not in silent)
        return (
            *((name, UNDETECTABLE) for name in silent),
            *((name, TOO_WIDE) for name in blind if not faults[name].vibration),
        )

    def outcome(self, stamp_ns: int, stand: StandStatus, episode: FaultEpisode | None) -> Decision:
        """Outcome and its words."""
        return self._rules.decide(stamp_ns, stand, episode)

    def unit(self, stand: StandStatus) -> ChannelQuality | None:
        """The row of another unit, where a quiet verdict says it."""
        return self._rules.unit(stand)

    def record(
        self, stamp_ns: int, stand: StandStatus, episode: FaultEpisode | None
    ) -> AmbiguityGroup:
        """The verdict as it goes out."""
        group = self._record(stamp_ns, stand, episode)
        return replace(group, looked_for=self._looked_for.of(group, STREAM in stand.bad))

    def _record(
        self, stamp_ns: int, stand: StandStatus, episode: FaultEpisode | None
    ) -> AmbiguityGroup:
        outcome, words = self.outcome(stamp_ns, stand, episode)
        if episode is None or stand.wired_wrong:
            return self._without_episode(stamp_ns, outcome, words + _remarks(stand, None), stand)
        shared = episode.shared
        members, dropped, response = candidates(episode, self._sizes)
        return AmbiguityGroup(
            stamp_ns=stamp_ns,
            outcome=outcome,
            episode=shared.number,
            step=episode.step,
            seq=0,
            members=members,
            dropped=dropped,
            detected_stamp_ns=shared.detected_ns,
            words=words + _remarks(stand, episode),
            calibration_sha256=self._k.calibration_sha256,
            source=self._source,
            not_observable=self._not_observable(stand) + self._hidden(outcome, stand, episode),
            features_computed=episode.query.computed,
            features_available=self._features_available(stand),
            opened_by=shared.opened_by,
            next_tests=self._next_tests(stamp_ns, outcome, stand, episode),
            offsets=stand.offsets,
            counters=stand.counters,
            stated_false_alarms_per_hour=self._stated_per_hour,
            supported_false_alarms_per_hour=self._supported_per_hour,
            to_do=to_do(response),
            pairs=tuple(TwoFaults(*p.faults, p.probability) for p in episode.second.pairs),
            shows_from=self._shows_from,
            comes_and_goes=() if episode.recurrence is None else (episode.recurrence,),
        )

    def _without_episode(
        self, stamp_ns: int, outcome: Outcome, words: str, stand: StandStatus
    ) -> AmbiguityGroup:
        return AmbiguityGroup(
            stamp_ns=stamp_ns,
            outcome=outcome,
            episode=0,
            step=0,
            seq=0,
            members=(),
            dropped=(),
            detected_stamp_ns=NEVER_NS,
            words=words,
            calibration_sha256=self._k.calibration_sha256,
            source=self._source,
            not_observable=self._not_observable(stand) + self._not_looked_for(stand),
            features_available=self._features_available(stand),
            offsets=stand.offsets,
            counters=stand.counters,
            stated_false_alarms_per_hour=self._stated_per_hour,
            supported_false_alarms_per_hour=self._supported_per_hour,
            shows_from=self._shows_from,
        )

    def _features_available(self, stand: StandStatus) -> int:
        return len(self._k.features.features) if stand.axes else 0

    def _next_tests(
        self, stamp_ns: int, outcome: Outcome, stand: StandStatus, episode: FaultEpisode
    ) -> tuple[NextTest, ...]:
        """Advice for a group that is not isolated further without a test."""
        # Advice rests on sizes in a motion throughout which the fault is there.
        if outcome is not Outcome.INDISTINGUISHABLE or episode.recurrence is not None:
            return ()
        return self._advice.tests(stamp_ns, episode, stand.axes)

    def _hidden(
        self, outcome: Outcome, stand: StandStatus, episode: FaultEpisode
    ) -> tuple[tuple[str, str], ...]:
        """Faults that could show here, but for what is named."""
        if outcome not in NAMING:
            return ()
        never = {fault for fault, _ in self._not_observable(stand)}
        named: Sequence[tuple[str, ...]] = [pair.faults for pair in episode.second.pairs]
        named = named or [(name,) for name in episode.names()]
        hidden = self._masking.hidden(named, episode.without_value())
        return tuple(row for row in hidden if row[0] not in never)

    def _not_looked_for(self, stand: StandStatus) -> tuple[tuple[str, str], ...]:
        """Faults that this stand can show, but whose tests had nothing to judge."""
        never = {fault for fault, _ in self._not_observable(stand)}
        found = stand.unjudged.faults(self._tests)
        return tuple((fault, why) for fault, why in found if fault not in never)

    def _not_observable(self, stand: StandStatus) -> tuple[tuple[str, str], ...]:
        """Faults that this stand cannot show, with the reason."""
        heard = bool(stand.axes) and not stand.deaf
        unseen = tuple(
            (fault.name, NO_RELATION)
            for fault in self._without_relation
            if not (fault.vibration and (heard or fault.approach == "data"))
        )
        if heard:
            return unseen + self._undetectable
        reason = f"shows only in vibration, and {stand.deaf}" if stand.deaf else NO_ACCELEROMETER
        vibration_only = tuple(
            (name, reason)
            for name, fault in self._k.faults.items()
            if fault.vibration and fault.approach == "data"
        )
        return vibration_only + unseen + self._undetectable


def _remarks(stand: StandStatus, episode: FaultEpisode | None) -> str:
    """Remarks that qualify a verdict, appended to its words."""
    single = episode is not None and not episode.second.pairs
    assumption = " (single-fault assumption)" if single else ""
    start = _another_unit(stand) + _accepted(stand) + _missed(stand) + _returned(stand, episode)
    start += RESUMED if episode is not None and episode.resumed else ""
    assumption += _outside(stand) if episode is not None else ""
    conditions = _at_its_end(stand) + _in_mode(stand) + _of_run(stand)
    return assumption + conditions + _taken_back(stand) + start


def _at_its_end(stand: StandStatus) -> str:
    """Remark that a stop holds the actuator, and what is not tested meanwhile."""
    if stand.contact is None:
        return ""
    since_s = (stand.contact.since_ns - stand.start_ns) / 1e9
    place, _, follows = stand.contact.reason.partition(": ")
    return f"; {place} since {since_s:.2f} s after the start, {follows}"


def _in_mode(stand: StandStatus) -> str:
    """Remark that the machine is in a mode that a channel tells, and what is not tested in it."""
    if stand.mode is None:
        return ""
    since_s = (stand.mode.since_ns - stand.start_ns) / 1e9
    name, _, follows = stand.mode.reason.partition(": ")
    said = f"; {name} since {since_s:.2f} s after the start"
    return f"{said}, {follows}" if follows else said


def _of_run(stand: StandStatus) -> str:
    """Remark on what this run has of its own, or that it is not known yet."""
    if stand.run is None:
        return ""
    since_s = (stand.run.since_ns - stand.start_ns) / 1e9
    return f"; {stand.run.reason}, since {since_s:.2f} s after the start"


def _outside(stand: StandStatus) -> str:
    """Remark that the motion is outside what the calibration has seen."""
    if stand.outside is None:
        return ""
    since_s = (stand.outside.since_ns - stand.start_ns) / 1e9
    return (
        f"; outside the calibration since {since_s:.2f} s after the start: {stand.outside.reason}"
    )


def _taken_back(stand: StandStatus) -> str:
    """Remark on the last alarm that was taken back, and why."""
    cleared = stand.taken_back
    if cleared is None:
        return ""
    since_s = (cleared.stamp_ns - stand.start_ns) / 1e9
    return f"; alarm {cleared.episode} {cleared.test}, since {since_s:.2f} s after the start"


def _another_unit(stand: StandStatus) -> str:
    """Remark that the unit was exchanged during the run."""
    if stand.unit_ns == NEVER_NS:
        return ""
    since_s = (stand.unit_ns - stand.start_ns) / 1e9
    relearned = ", sensor offsets relearned" if stand.offsets else ""
    return f"; unit exchanged {since_s:.2f} s after the start{relearned}"


def _accepted(stand: StandStatus) -> str:
    """Remark that a unit beyond what healthy units differ by counts as healthy, and who said so."""
    if stand.accepted is None:
        return ""
    since_s = (stand.accepted.stamp_ns - stand.start_ns) / 1e9
    why = f": {shown(stand.accepted.text)}" if stand.accepted.text else ""
    by = shown(stand.accepted.author)
    return f"; unit accepted as healthy by {by} {since_s:.2f} s after the start{why}"


def _missed(stand: StandStatus) -> str:
    """Remark that the observer started later than the stand."""
    if NEVER_NS in (stand.table_ns, stand.began_ns) or stand.returned_ns != NEVER_NS:
        return ""
    late_s = (stand.began_ns - stand.table_ns) / 1e9
    if late_s < LATE_S:
        return ""
    return (
        f"; observation began {late_s:.2f} s after stand start: a fault already present at start "
        "may have been learned as baseline"
    )


def _returned(stand: StandStatus, episode: FaultEpisode | None) -> str:
    """Remark that the observer was restarted during the run."""
    if stand.returned_ns == NEVER_NS:
        return ""
    at_s = (stand.returned_ns - stand.start_ns) / 1e9
    words = f"; observer restarted {at_s:.2f} s after the start"
    if episode is not None and episode.shared.taken_over:
        words += ", thermal residuals disabled until reset; only ~/reset ends this episode"
    return words
