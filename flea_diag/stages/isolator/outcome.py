"""Which outcome the state of the isolator amounts to, and in which words.

The order of the questions is the order of the functions: does the calibration fit, is there
an episode, what is left of its hypotheses; and without one, is anything to be seen at all.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence

from flea_diag.core.isolation.isolation import Hypothesis
from flea_diag.core.likelihood.fault_models import FaultModel
from flea_diag.stages.isolator.ambiguity import Ambiguity
from flea_diag.stages.isolator.fault_episode import FaultEpisode, relation
from flea_diag.stages.isolator.parameters import IsolatorParameters, Knowledge
from flea_diag.stages.isolator.stand_status import SEEN_MOVING, StandStatus, astray, rested
from flea_diag.wire.records import DRIVER_DEAD, STARVING, STREAM, Outcome

Decision = tuple[Outcome, str]
"""An outcome and its words."""

EARLY_NS = 8_000_000_000
"""A deviation within this time of the stream's start was there before it."""
NEEDED = ("motor_current", "load_force", "actuator_position")
"""Without these the stand shows too little of the actuator to say anything."""
LOST = (
    "the state observer has lost its track and no relation says why: the calibration does not "
    "fit this actuator, calibrate on its own recordings"
)
UNTOLD = (
    "readings leave the state observer's prediction; no relation that would say which fault has "
    "deviated yet"
)
LEFT = "an episode from before observer and isolator came back: what was found of it is lost"
AT_REST = "the actuator does not move: faults of motor and screw show only in motion"


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
        self._ambiguity = Ambiguity(knowledge.features, models, quantified)

    def decide(self, stamp_ns: int, stand: StandStatus, episode: FaultEpisode | None) -> Decision:
        """Outcome and its words."""
        if stand.mismatch:
            return Outcome.MODEL_MISMATCH, stand.mismatch
        if episode is None:
            # Not beyond what was seen: the record that is due may come after a leap of the clock.
            if astray(min(stamp_ns, stand.last_ns), stand.lost_ns):
                return Outcome.MODEL_MISMATCH, LOST
            return self._quiet(stamp_ns, stand)
        outcome, words = self._of_episode(stamp_ns, stand, episode)
        early = episode.shared.detected_ns - max(stand.first_ns, stand.unit_ns) <= EARLY_NS
        if outcome is Outcome.UNEXPLAINED and early:
            return (
                Outcome.MODEL_MISMATCH,
                f"{words}, and so from the start: the calibration does not fit this actuator",
            )
        return outcome, words

    def _of_episode(self, stamp_ns: int, stand: StandStatus, episode: FaultEpisode) -> Decision:
        alive = episode.isolation.alive()
        names = ", ".join(h.name for h in alive)
        what = f" ({episode.shared.opened_by})"
        if episode.awaits_symbols:
            return Outcome.DETECTED, LEFT if episode.shared.taken_over else UNTOLD
        if not alive:
            return Outcome.UNEXPLAINED, f"a deviation that no fault of the catalogue explains{what}"
        if not episode.settled or episode.query.is_open(stamp_ns, self._patience_ns):
            return Outcome.DETECTED, f"a fault, one of: {names}"
        if self._is_unexplained(episode, alive):
            return Outcome.UNEXPLAINED, f"a deviation that none of {names} explains well{what}"
        if len(alive) == 1:
            return Outcome.ISOLATED, f"the fault is {names}"
        why = self._ambiguity.reason(stand, episode, alive)
        return Outcome.INDISTINGUISHABLE, f"one of {names}: {why}"

    def _is_unexplained(self, episode: FaultEpisode, alive: list[Hypothesis]) -> bool:
        """Relations deviate, every hypothesis has a model of them, and none gains on 'no fault'."""
        deviating = {relation(residual) for residual, _, _ in episode.symbols}
        if not deviating or not deviating <= self._quantified:
            return False
        if any(h.fit is None for h in alive):
            return False
        return max(h.log_likelihood for h in alive) < self._explain_nats

    def _quiet(self, stamp_ns: int, stand: StandStatus) -> Decision:
        bad = [channel for channel in NEEDED if channel in stand.bad]
        if STREAM in stand.bad:
            return Outcome.DATA_UNUSABLE, DRIVER_DEAD if bad else STARVING
        if bad:
            return Outcome.DATA_UNUSABLE, f"{', '.join(bad)} cannot be used, other channels can"
        resting = rested(stamp_ns, stand.moved_ns, self._rest_ns)
        if stand.moved < SEEN_MOVING or resting:
            return Outcome.NOT_OBSERVABLE, AT_REST
        return Outcome.NOMINAL, "nothing deviates"
