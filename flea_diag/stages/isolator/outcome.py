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

"""Outcome of the diagnosis, and its words, from the state of stand and episode.

Decided in this order: does the calibration fit, is an episode open, which hypotheses remain;
without an episode, are the data usable and is the actuator observable.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence

from flea_diag.core.isolation.goodness_of_fit import GoodnessOfFit, Misfit
from flea_diag.core.isolation.hypothesis import Hypothesis
from flea_diag.core.likelihood.fault_models import FaultModel
from flea_diag.stages.episode import Episode
from flea_diag.stages.isolator.ambiguity import Ambiguity
from flea_diag.stages.isolator.fault_episode import FaultEpisode
from flea_diag.stages.isolator.parameters import IsolatorParameters, Knowledge
from flea_diag.stages.isolator.stand_status import StandStatus, diverged, rested
from flea_diag.stages.recurrence.recurrence_words import recurrence_words
from flea_diag.wire.records import (
    DRIVER_DEAD,
    STARVING,
    STREAM,
    ChannelQuality,
    Outcome,
    Quality,
    Recurrence,
)

Decision = tuple[Outcome, str]
"""An outcome and its words."""

DIVERGED = (
    "state observer diverged and no residual isolates a cause: the calibration does not fit this "
    "actuator, calibrate on its own recordings"
)
OTHER_RATE = (
    "nothing is tested; send at that rate, or calibrate on recordings of this one, at which scans "
    "are made (rate_hz of channels.yaml for flea import and the bridge)"
)
REMEDY = "calibrate on recordings of this unit"
NAMING = (Outcome.ISOLATED, Outcome.INDISTINGUISHABLE)
NOT_ISOLATING = "innovation above threshold; no isolating residual yet"
NOT_WEIGHED = "vibration outside its nominal range; no relation is weighed yet"
EVIDENCE_LOST = "episode opened before observer and isolator restarted; its evidence is lost"
AT_REST = "actuator at rest: motor and screw faults are observable only in motion"
NO_DEVIATION = "no deviation"


class OutcomeRules:
    """Decides the outcome of an episode, or of its absence."""

    def __init__(
        self,
        knowledge: Knowledge,
        parameters: IsolatorParameters,
        models: Sequence[FaultModel],
        quantified: Collection[str],
    ) -> None:
        self._quantified = frozenset(quantified)
        self._explain_nats = parameters.explain_nats
        self._patience_ns = round(parameters.feature_patience_s * 1e9)
        self._rest_ns = parameters.rest_s * 1e9
        self._residuals = knowledge.effects.residuals
        self._fit = GoodnessOfFit(knowledge.calibration, knowledge.moved)
        self._ambiguity = Ambiguity(knowledge.features, models, quantified, self._residuals)

    def decide(self, stamp_ns: int, stand: StandStatus, episode: FaultEpisode | None) -> Decision:
        """Outcome and its words."""
        if stand.mismatch:
            return Outcome.MODEL_MISMATCH, stand.mismatch
        if stand.off_rate:
            return Outcome.MODEL_MISMATCH, f"{stand.off_rate.partition(';')[0]}: {OTHER_RATE}"
        if stand.wired_wrong:
            return Outcome.DATA_UNUSABLE, stand.wired_wrong
        if (
            episode is None
            and stand.wiring is not None
            and stand.wiring.quality is not Quality.GOOD
        ):
            return Outcome.DATA_UNUSABLE, stand.wiring.reason
        if episode is None:
            # At most the last scan: the record being answered may come after a jump of the clock.
            if diverged(min(stamp_ns, stand.last_ns), stand.lost_ns):
                return Outcome.MODEL_MISMATCH, DIVERGED
            if stand.beyond:
                return Outcome.MODEL_MISMATCH, f"{stand.beyond}: {REMEDY}"
            return self._quiet(stamp_ns, stand)
        outcome, words = self._of_episode(stamp_ns, stand, episode)
        if stand.wiring is not None and not episode.is_vibration_only:
            return self._beside_wiring(stand.wiring, outcome, words)
        early = stand.is_early(episode.shared.detected_ns)
        if outcome is Outcome.UNEXPLAINED and early:
            return (
                Outcome.MODEL_MISMATCH,
                f"{words}; present since the start: the calibration does not fit this actuator",
            )
        if early and outcome in NAMING and stand.other_unit is not None:
            known = episode.isolation.hypotheses
            if self._is_of_unit([known[name] for name in episode.said()]):
                names = " or ".join(episode.said())
                return (
                    Outcome.MODEL_MISMATCH,
                    f"{stand.other_unit.reason}; present since the start, as {names} would be: "
                    f"{REMEDY}",
                )
        return outcome, words

    def _beside_wiring(self, wiring: ChannelQuality, outcome: Outcome, words: str) -> Decision:
        """Outcome of an episode that the wiring of a channel may explain."""
        if wiring.quality is Quality.GOOD:
            return Outcome.DETECTED, f"{words}; {wiring.reason}"
        if outcome is Outcome.DETECTED:
            return outcome, f"{words}; or {wiring.reason}"
        if outcome is Outcome.UNEXPLAINED:
            return Outcome.DATA_UNUSABLE, wiring.reason
        return Outcome.INDISTINGUISHABLE, f"{words}; or {wiring.reason}"

    def _is_of_unit(self, alive: list[Hypothesis]) -> bool:
        """Whether what another unit shows from the start is that it is another one.

        What parameters of the motor and the screw have changed in is no error of a reading.
        """
        return all(h.fault.channel for h in alive)

    def unit(self, stand: StandStatus) -> ChannelQuality | None:
        """The row of another unit, where the words of a quiet verdict say it."""
        return None

    def _of_episode(self, stamp_ns: int, stand: StandStatus, episode: FaultEpisode) -> Decision:
        alive = episode.isolation.alive()
        names = ", ".join(h.name for h in alive)
        what = f" ({episode.shared.opened_by})"
        if episode.recurrence is not None:
            return _recurring(alive, episode.recurrence, stand.start_ns)
        if episode.awaits_symbols:
            return Outcome.DETECTED, _awaited(episode.shared)
        if episode.second.pairs:
            return Outcome.INDISTINGUISHABLE, episode.second.words(stand.start_ns)
        if not alive:
            return Outcome.UNEXPLAINED, f"no fault of the catalogue explains the deviation{what}"
        if not episode.settled or episode.query.is_open(stamp_ns, self._patience_ns):
            return Outcome.DETECTED, f"fault detected, one of: {names}"
        if (against := self._contradiction(episode, alive)) is not None:
            return Outcome.UNEXPLAINED, f"none of {names} explains the deviation{what}{against}"
        if len(alive) == 1:
            return Outcome.ISOLATED, f"the fault is {names}"
        why = self._ambiguity.reason(stand, episode, alive)
        return Outcome.INDISTINGUISHABLE, f"one of {names}: {why}"

    def _contradiction(self, episode: FaultEpisode, alive: list[Hypothesis]) -> str | None:
        """What speaks against all that are left, if any is known; None where one of them fits."""
        if self._is_unexplained(episode, alive):
            return ""
        poor = self._misfits(episode, alive)
        why = (f"{m.residual} keeps {m.scatter:.1f} times its healthy scatter (limit {m.limit:.1f})"
               for m in poor)  # fmt: skip
        if poor:
            return f": {', '.join(why)}"
        beyond = episode.unweighed()
        return f": {', '.join(beyond)} deviates, as none of them would" if beyond else None

    def _is_unexplained(self, episode: FaultEpisode, alive: list[Hypothesis]) -> bool:
        """Whether no quantified hypothesis explains the residuals better than 'no fault' does."""
        return episode.gains_less(self._explain_nats, self._quantified, alive)

    def _misfits(self, episode: FaultEpisode, alive: list[Hypothesis]) -> tuple[Misfit, ...]:
        """Relations that the most likely hypothesis does not fit, if no other fits either."""
        left = self._fit.left_by_all(
            episode.evidence.equations.now, ((h.fault, h.fit) for h in alive)
        )
        return left or episode.second.misfits

    def _quiet(self, stamp_ns: int, stand: StandStatus) -> Decision:
        bad = [channel for channel in self._residuals.required if channel in stand.bad]
        if STREAM in stand.bad:
            return Outcome.DATA_UNUSABLE, DRIVER_DEAD if bad else STARVING
        if bad:
            return Outcome.DATA_UNUSABLE, f"{', '.join(bad)} unusable; the other channels are valid"
        lost = stand.unjudged.nothing_left(self._residuals.relations, self._residuals.friction)
        if lost:
            return Outcome.DATA_UNUSABLE, f"not judged in the last 10 s: {lost}"
        resting = rested(stamp_ns, stand.moved_ns, self._rest_ns)
        if not stand.seen_moving or resting:
            return Outcome.NOT_OBSERVABLE, AT_REST
        if stand.outside is not None:
            return Outcome.NOT_OBSERVABLE, f"outside the calibration: {stand.outside.reason}"
        unjudged = stand.unjudged.words()
        limits = f" in what was judged; not judged in the last 10 s: {unjudged}"
        return Outcome.NOMINAL, NO_DEVIATION + (limits if unjudged else "")


def _recurring(alive: list[Hypothesis], told: Recurrence, start_ns: int) -> Decision:
    """Of faults that come and go."""
    names, words = ", ".join(h.name for h in alive), recurrence_words(told, start_ns)
    if len(alive) == 1:
        return Outcome.ISOLATED, f"the fault is {names}, which {words}"
    return Outcome.INDISTINGUISHABLE, f"one of {names}, which {words}"


def _awaited(shared: Episode) -> str:
    """Why nothing is known of an episode yet."""
    if shared.taken_over:
        return EVIDENCE_LOST
    return NOT_WEIGHED if shared.opened_by_vibration else NOT_ISOLATING
