"""From the state of the isolator to what is said: the outcome, its words, the record.

The order of the questions is the order of the functions: does the calibration fit, is there
an episode, what is left of its hypotheses; and without one, is anything to be seen at all.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Sequence

from flea_diag.core.calibration.calibration import Calibration
from flea_diag.core.choice.feature_choice import FeatureChooser
from flea_diag.core.isolation.detectability import undetectable
from flea_diag.core.isolation.isolation import Hypothesis
from flea_diag.core.likelihood.fault_models import FaultModel
from flea_diag.core.likelihood.isolability import computable, isolable, required_channels
from flea_diag.stages.isolator.advice import Advice
from flea_diag.stages.isolator.episode import Episode, relation
from flea_diag.stages.isolator.parameters import IsolatorParameters, Knowledge
from flea_diag.stages.isolator.stand_status import SEEN_MOVING, Standing, astray, rested
from flea_diag.wire.records import (
    BY_DESIGN,
    DRIVER_DEAD,
    NEVER_NS,
    STARVING,
    STREAM,
    AmbiguityGroup,
    Candidate,
    ChannelTable,
    Evidence,
    NextTest,
    Outcome,
)

EARLY_NS = 8_000_000_000
"""A deviation within this time of the stream's start was there before it."""
LOST = (
    "the state observer has lost its track and no relation says why: the calibration does not "
    "fit this actuator, calibrate on its own recordings"
)
UNDETECTABLE = (
    "even at its largest it moves no residual of this stand beyond its limit; a second sensor of "
    "the same quantity would show it"
)
UNTOLD = (
    "readings leave the state observer's prediction; no relation that would say which fault has "
    "deviated yet"
)
LATE_S = 2.0
"""A stand that began so long before the observer's first scan was not watched meanwhile."""
LEFT = "an episode from before observer and isolator came back: what was found of it is lost"
NEEDED = ("motor_current", "load_force", "actuator_position")
"""Without these the stand shows too little of the actuator to say anything."""


class Verdict:
    """Says what an episode, or its absence, amounts to."""

    def __init__(
        self,
        knowledge: Knowledge,
        parameters: IsolatorParameters,
        models: Sequence[FaultModel],
        weighed: Collection[str],
    ) -> None:
        self._k = knowledge
        self._p = parameters
        self._models = tuple(models)
        self._weighed = weighed
        self._undetectable = tuple(
            (name, UNDETECTABLE)
            for name in undetectable(knowledge.faults, self._models, knowledge.calibration)
        )
        self._advice = Advice(knowledge, parameters, self._models)
        self._chooser = FeatureChooser(knowledge.features, "information")

    def outcome(
        self, stamp_ns: int, standing: Standing, episode: Episode | None
    ) -> tuple[Outcome, str]:
        """Outcome and its words."""
        if standing.mismatch:
            return Outcome.MODEL_MISMATCH, standing.mismatch
        if episode is None:
            # Not beyond what was seen: the record that is due may come after a leap of the clock.
            if astray(min(stamp_ns, standing.last_ns), standing.lost_ns):
                return Outcome.MODEL_MISMATCH, LOST
            return self._quiet(stamp_ns, standing)
        outcome, words = self._of_episode(stamp_ns, standing, episode)
        early = episode.start_ns - max(standing.first_ns, standing.unit_ns) <= EARLY_NS
        if outcome is Outcome.UNEXPLAINED and early:
            return (
                Outcome.MODEL_MISMATCH,
                f"{words}, and so from the start: the calibration does not fit this actuator",
            )
        return outcome, words

    def _of_episode(
        self, stamp_ns: int, standing: Standing, episode: Episode
    ) -> tuple[Outcome, str]:
        alive = episode.isolation.alive()
        names = ", ".join(h.name for h in alive)
        what = f" ({episode.opened_by})"
        if not episode.symbols and not episode.settled:
            return Outcome.DETECTED, LEFT if episode.taken_over else UNTOLD
        if not alive:
            return Outcome.UNEXPLAINED, f"a deviation that no fault of the catalogue explains{what}"
        patience_ns = round(self._p.feature_patience_s * 1e9)
        if not episode.settled or episode.inquiry.is_open(stamp_ns, patience_ns):
            return Outcome.DETECTED, f"a fault, one of: {names}"
        if self._unexplained(episode, alive):
            return Outcome.UNEXPLAINED, f"a deviation that none of {names} explains well{what}"
        if len(alive) == 1:
            return Outcome.ISOLATED, f"the fault is {names}"
        why = self._why_not_split(standing, episode, alive)
        return Outcome.INDISTINGUISHABLE, f"one of {names}: {why}"

    def _unexplained(self, episode: Episode, alive: list[Hypothesis]) -> bool:
        """Relations deviate, every hypothesis has a model of them, and none gains on 'no fault'."""
        deviating = [relation(residual) for residual, _, _ in episode.symbols]
        weighable = bool(deviating) and set(deviating) <= set(self._weighed)
        if not weighable or any(h.fit is None for h in alive):
            return False
        return max(h.log_likelihood for h in alive) < self._p.explain_nats

    def _why_not_split(self, standing: Standing, episode: Episode, alive: list[Hypothesis]) -> str:
        """What is alike in every relation that there is, no slow evidence can ever tell apart."""
        names = [h.name for h in alive]
        if episode.inquiry.computed:
            return "not split by this evidence"
        if not isolable(self._models, names, self._weighed):
            return self._would_vibration(standing, episode, alive)
        left = computable(self._weighed, standing.bad)
        if len(left) < len(self._weighed) and not isolable(self._models, names, left):
            lost = ", ".join(channel for channel in standing.bad if self._reads(channel))
            return f"cannot be split without {lost}, {BY_DESIGN}; sound readings of it would"
        return "not split by this evidence"

    def _would_vibration(
        self, standing: Standing, episode: Episode, alive: list[Hypothesis]
    ) -> str:
        """Whether vibration would tell apart what relations cannot."""
        if not standing.axes and any(h.fault.vibration for h in alive):
            return f"cannot be split by this sensor set, {BY_DESIGN}; accelerometers would"
        if not standing.axes or self._chooser.next(episode.group()) is None:
            return f"cannot be split by this sensor set, {BY_DESIGN}"
        return "not split yet: features of vibration would, on a usable second of motion"

    def _reads(self, channel: str) -> bool:
        """Whether a relation that is weighed needs this channel."""
        return any(channel in required_channels(residual) for residual in self._weighed)

    def _quiet(self, stamp_ns: int, standing: Standing) -> tuple[Outcome, str]:
        bad = [channel for channel in NEEDED if channel in standing.bad]
        if STREAM in standing.bad:
            return Outcome.DATA_UNUSABLE, DRIVER_DEAD if bad else STARVING
        if bad:
            return Outcome.DATA_UNUSABLE, f"{', '.join(bad)} cannot be used, other channels can"
        resting = rested(stamp_ns, standing.moved_ns, self._p.rest_s * 1e9)
        if standing.moved < SEEN_MOVING or resting:
            return (
                Outcome.NOT_OBSERVABLE,
                "the actuator does not move: faults of motor and screw show only in motion",
            )
        return Outcome.NOMINAL, "nothing deviates"

    def record(self, stamp_ns: int, standing: Standing, episode: Episode | None) -> AmbiguityGroup:
        """The verdict as it goes out."""
        outcome, words = self.outcome(stamp_ns, standing, episode)
        alive = episode.isolation.alive() if episode is not None else []
        dropped = episode.isolation.dropped() if episode is not None else []
        suffix = " (single-fault assumption)" if episode is not None else ""
        if standing.unit_ns != NEVER_NS:
            since_s = (standing.unit_ns - standing.first_ns) / 1e9
            suffix += (
                f"; another unit since {since_s:.2f} s after the start, its offsets learned anew"
            )
        suffix += _missed(standing) + _returned(standing, episode)
        return AmbiguityGroup(
            stamp_ns=stamp_ns,
            outcome=outcome,
            episode=episode.number if episode is not None else 0,
            step=episode.step if episode is not None else 0,
            seq=0,
            members=tuple(_candidate(h, self._models) for h in alive),
            dropped=tuple(_candidate(h, self._models) for h in dropped),
            detected_stamp_ns=episode.start_ns if episode is not None else NEVER_NS,
            words=words + suffix,
            calibration_sha256=self._k.calibration_sha256,
            source=self._p.source,
            not_observable=self._not_observable(standing),
            features_computed=episode.inquiry.computed if episode is not None else (),
            features_available=len(self._k.features.features) if standing.axes else 0,
            opened_by=episode.opened_by if episode is not None else "",
            next_tests=self._next_tests(stamp_ns, outcome, standing, episode),
            offsets=standing.offsets,
            counters=standing.counters,
        )

    def _next_tests(
        self, stamp_ns: int, outcome: Outcome, standing: Standing, episode: Episode | None
    ) -> tuple[NextTest, ...]:
        """Advice for a group that nothing splits any further by itself."""
        if outcome is not Outcome.INDISTINGUISHABLE or episode is None:
            return ()
        return self._advice.tests(stamp_ns, episode, standing.axes)

    def _not_observable(self, standing: Standing) -> tuple[tuple[str, str], ...]:
        """Faults that this stand cannot show, with the reason."""
        if standing.axes:
            return self._undetectable
        reason = "shows only in vibration, and this stand has no accelerometer"
        unheard = tuple(
            (name, reason)
            for name, fault in self._k.faults.items()
            if fault.vibration and fault.approach == "data"
        )
        return unheard + self._undetectable


def _missed(standing: Standing) -> str:
    """What it means that nobody watched the stand when it began."""
    if NEVER_NS in (standing.table_ns, standing.began_ns) or standing.returned_ns != NEVER_NS:
        return ""
    late_s = (standing.began_ns - standing.table_ns) / 1e9
    if late_s < LATE_S:
        return ""
    return (
        f"; watched from {late_s:.2f} s after the stand's start on: a fault of before may pass for "
        "this unit's own"
    )


def _returned(standing: Standing, episode: Episode | None) -> str:
    """What the return of an observer means for the verdict."""
    if standing.returned_ns == NEVER_NS:
        return ""
    at_s = (standing.returned_ns - standing.first_ns) / 1e9
    words = f"; the observer came back {at_s:.2f} s after the start"
    if episode is not None and episode.taken_over:
        words += ", so that temperatures say no more and only ~/reset ends this episode"
    return words


def mismatch(calibration: Calibration, table: ChannelTable) -> str:
    """What keeps a calibration from being used on a stand with this channel table, or ""."""
    here = {row.name for row in table.channels}
    missing = [name for name in calibration.channels if name not in here]
    if missing:
        return (
            f"the calibration is of a stand with {missing[0]}, this one has none: "
            "calibrate on recordings of this stand"
        )
    voltage = table.info("motor_voltage")
    if voltage is not None and voltage.sampling != calibration.voltage_sampling:
        return (
            f"the calibration is for a voltage sampled as {calibration.voltage_sampling!r}, this "
            f"stand samples {voltage.sampling!r}: calibrate on recordings of this stand"
        )
    return ""


def _candidate(hypothesis: Hypothesis, models: Sequence[FaultModel]) -> Candidate:
    size, sigma, unit = math.nan, math.nan, ""
    if hypothesis.fit is not None:
        sizes = hypothesis.fit.sizes
        model = next(m for m in models if m.fault == hypothesis.name and len(m.sizes) == len(sizes))
        # The first that is there: a drag may be a viscous one alone.
        index = next((k for k, value in enumerate(sizes) if value), 0)
        size, sigma = sizes[index], hypothesis.fit.sigmas[index]
        unit = model.sizes[index].unit
    return Candidate(
        hypothesis.name,
        hypothesis.deviation,
        hypothesis.probability if not hypothesis.why_dropped else 0.0,
        hypothesis.why_dropped or "fits everything seen so far",
        tuple(
            Evidence(f.stamp_ns, f.source, f.observed, f.predicted, f.words, f.path)
            for f in hypothesis.checks
        ),
        size,
        sigma,
        unit,
    )
