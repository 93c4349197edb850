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


"""Looks for a second fault in the episode of a first: when to search, in what evidence."""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import cache

from flea_diag.core.faults.fault import Fault
from flea_diag.core.isolation.fault_pairs import FaultPairs
from flea_diag.core.isolation.goodness_of_fit import GoodnessOfFit
from flea_diag.core.isolation.missing_jump import JumpMemory, missing_jump
from flea_diag.core.isolation.pair_clues import Clues
from flea_diag.core.isolation.pair_models import Models, by_fault, delayed
from flea_diag.core.likelihood.effect_set import name_of
from flea_diag.core.likelihood.effects import ELAPSED
from flea_diag.core.likelihood.estimation import fitted
from flea_diag.core.likelihood.evidence_sums import EvidenceSums
from flea_diag.core.likelihood.fault_models import FaultModel, Size, Term
from flea_diag.core.likelihood.fit import Fit
from flea_diag.core.likelihood.weighing import Weighing
from flea_diag.core.symbolic.expression import ONE
from flea_diag.stages.isolator.fault_episode import BOTH_WAYS_S, FaultEpisode
from flea_diag.stages.isolator.pairs.second_fault import LOOK_EVERY, Look
from flea_diag.stages.isolator.parameters import IsolatorParameters, Knowledge
from flea_diag.stages.isolator.quantitative_isolation import QuantitativeIsolation
from flea_diag.stages.isolator.stand_status import StandStatus

LEAST_NS = 4_000_000_000
"""Evidence of both faults before pairs are searched."""
LEVEL_NS = 30_000_000_000
"""Time after the detection in which a unit keeps the level that it has shown before: as long as
tests hold it against that. Then a winding has warmed."""
RECENT_NS = 10_000_000_000
"""Age of an episode from which on the second fault may have begun within it, though no single one
ever explained it."""


class SecondFaultSearch:
    """Finds second faults in episodes of one stand."""

    def __init__(
        self,
        knowledge: Knowledge,
        parameters: IsolatorParameters,
        quantitative: QuantitativeIsolation,
        stand: StandStatus,
        jumps: JumpMemory,
    ) -> None:
        self._quantitative, self._stand, self._jumps = quantitative, stand, jumps
        self._drop_nats, self._explain_nats = parameters.drop_nats, parameters.explain_nats
        self._goodness = GoodnessOfFit(knowledge.calibration, knowledge.moved, knowledge.heated)
        known = by_fault(quantitative.models)
        self._models = {
            name: known.get(name, [FaultModel(name, (), ())]) for name in knowledge.faults
        }
        self._heats = _heats(knowledge)
        dead = knowledge.deaths(self._models)
        self._pairs = FaultPairs(knowledge.faults, self._goodness, dead)

    def look(self, stamp_ns: int, episode: FaultEpisode) -> None:
        """Look at an episode every two seconds."""
        second = episode.second
        if episode.evaluated % LOOK_EVERY or not self._applies(episode):
            return
        sums = episode.evidence.equations.now
        now = Look(stamp_ns, sums.copy(), episode.evidence.motion)
        if second.pairs:
            self._follow(stamp_ns, episode, sums)
        elif self._is_suspected(episode, sums):
            second.suspect(now)
            if second.is_due():
                self._search(stamp_ns, episode, sums)
        elif not (second.is_due() and self._adds_much(stamp_ns, episode, sums)):
            second.explain(episode.names())
        second.keep(now)

    def _applies(self, episode: FaultEpisode) -> bool:
        """Whether relations decide, and not from the start: then the calibration may not fit."""
        shared = episode.shared
        early = self._stand.is_early(shared.detected_ns) and not episode.second.firsts
        relations = bool(episode.symbols) and not shared.opened_by_vibration
        relations = relations and not episode.isolation.lacks_jump
        return episode.settled and relations and not early and not shared.taken_over

    def _is_suspected(self, episode: FaultEpisode, sums: EvidenceSums) -> bool:
        """Whether no single fault explains everything."""
        second, alive = episode.second, episode.isolation.alive()
        second.misfits = ()
        if not alive:
            return True
        if episode.gains_less(self._explain_nats, self._quantitative.names, alive):
            return True
        if self._goodness.exceeded_by_all(sums, ((h.fault, h.fit) for h in alive)):
            return True
        exceeded, recent = False, second.recent(sums)
        if recent is not None:
            fits = self._fits(episode, recent, [h.name for h in alive])
            rows = [(h.fault, fits.get(h.name)) for h in alive]
            second.misfits = self._goodness.left_by_all(recent, rows)
            exceeded = self._goodness.exceeded_by_all(recent, rows)
        return bool(exceeded or episode.isolation.overruled)

    def _fits(
        self, episode: FaultEpisode, sums: EvidenceSums, names: Sequence[str]
    ) -> dict[str, Fit]:
        """The best fit of each fault alone."""
        models = [m for name in names for m in self._models[name] if m.sizes]
        if not models:
            return {}
        found: dict[str, Fit] = {}
        for fit in fitted(sums, models, self._quantitative.weighing(episode, sums)):
            if fit.log_likelihood >= found.get(fit.fault, fit).log_likelihood:
                found[fit.fault] = fit
        return found

    def _search(self, stamp_ns: int, episode: FaultEpisode, sums: EvidenceSums) -> None:
        """Search in the evidence since a single fault explained all; else in all, then of late."""
        second = episode.second
        if second.firsts:
            starts: list[Look | None] = [second.suspected]
        else:
            starts = [None]
            if second.looks and stamp_ns - episode.shared.detected_ns > RECENT_NS:
                starts.append(second.looks[0])
        for start in starts:
            second.start = start
            if self._find(stamp_ns, episode, sums, ()):
                return
        second.start = None

    def _adds_much(self, stamp_ns: int, episode: FaultEpisode, sums: EvidenceSums) -> bool:
        """Whether a pair explains so much more than those that are left that it holds.

        In all of the evidence, or since one of the looks: the second one may have begun then.
        """
        names, second = episode.names(), episode.second
        if len(self._known(names)) < len(names):
            return False
        for start in (None, *second.starts):
            second.start = start
            if self._find(stamp_ns, episode, sums, (), unasked=True):
                second.firsts = names
                return True
        second.start = None
        return False

    def _weighing(self, stamp_ns: int, episode: FaultEpisode, sums: EvidenceSums) -> Weighing:
        """What evidence weighs of which those that are left explain all, or do not.

        What they leave may be another unit that has come with its fault; with an error of a reading
        none comes, and all that the unit has shown before holds for a while, or for pairs that it
        has told.
        """
        same = _is_of_reading(episode)
        fresh = stamp_ns - episode.shared.detected_ns <= LEVEL_NS or bool(episode.second.pairs)
        is_same_unit = bool(episode.second.suspected) or same
        return self._quantitative.weighing(episode, sums, is_same_unit, same and fresh)

    def _follow(self, stamp_ns: int, episode: FaultEpisode, sums: EvidenceSums) -> None:
        """Hold the pairs against what has come since; what is left of them, they shrink."""
        known = [pair.faults for pair in episode.second.pairs]
        self._find(stamp_ns, episode, sums, known)

    def _find(
        self,
        stamp_ns: int,
        episode: FaultEpisode,
        sums: EvidenceSums,
        only: Sequence[tuple[str, str]],
        unasked: bool = False,
    ) -> bool:
        """Whether pairs hold; ``unasked``: looked for only where a second fault may add much."""
        second, start = episode.second, episode.second.start
        begin_ns = start.stamp_ns if start else episode.shared.detected_ns
        if start is None:
            moved = episode.evidence.moved_channels()
            enough = episode.is_conclusive()
        else:
            sums = sums.since(start.sums)
            both_ways_s, moved = episode.evidence.since(start.motion)
            # A balance with the friction that has had no value since tells no drag from a bias.
            held = dict(zip(sums.residuals, sums.blocks, strict=True))
            asks = episode.asks_both_ways and held.get(episode.residuals.friction, 0.0) >= 1.0
            enough = not asks or both_ways_s >= BOTH_WAYS_S
        if not enough or stamp_ns - begin_ns < LEAST_NS:
            return False
        clues = self._clues(stamp_ns, episode, begin_ns, moved, unasked)
        weighing = self._weighing(stamp_ns, episode, sums)
        later = self._later((begin_ns - episode.shared.detected_ns) / 1e9)
        if unasked and not self._pairs.may_add(sums, self._models, later, weighing, clues):
            return False
        second.pairs = self._pairs.search(
            sums,
            self._models,
            later,
            weighing,
            clues,
            self._drop_nats,
            only,
        )
        return bool(second.pairs)

    def _known(self, names: Sequence[str]) -> tuple[str, ...]:
        """Those of them that have a model."""
        return tuple(name for name in names if self._models[name][0].sizes)

    def _later(self, after_s: float) -> Models:
        """Models of faults that began with the evidence."""
        if not after_s:
            return self._models
        return {
            name: [delayed(m, name_of(ELAPSED), name_of(ONE), after_s) for m in models]
            for name, models in self._models.items()
        }

    def _clues(
        self,
        stamp_ns: int,
        episode: FaultEpisode,
        begin_ns: int,
        moved: Sequence[str],
        unasked: bool,
    ) -> Clues:
        """What signs and single sensors say of faults that began then."""
        isolation, symbols = episode.isolation, episode.magnitudes()
        start, left = episode.second.start, episode.names()
        firsts = () if start is None else left if unasked else episode.second.firsts
        followed_s = (stamp_ns - begin_ns) / 1e9
        predicted = {
            name: found
            for name, found in isolation.predicted().items()
            if self._models[name][0].sizes or found
            if name in firsts
            or not isolation.symbols.absent(
                isolation.hypotheses[name].fault, symbols, moved, True, followed_s
            )
        }
        jumps = self._jumps.largest(episode.shared.detected_ns, stamp_ns, episode.told_by)

        def is_possible(fault: Fault, fit: Fit) -> bool:
            return fault.name in firsts or not missing_jump(fault, fit, jumps)

        relation, known = episode.residuals.relation, self._quantitative.names
        weighed = frozenset(name for name in isolation.seen if relation(name) in known)
        rivals = self._known(left) if unasked or start is None else ()
        rivals = tuple(name for name in rivals if name in predicted)
        lone = () if _is_of_reading(episode) else episode.residuals.lone_temperature
        heats = {**self._heats, **{name: _of_another_unit(name) for name in lone}}
        uneven = frozenset({episode.residuals.friction})
        given = predicted, isolation.seen, weighed, firsts, is_possible, rivals
        return Clues(*given, heats, uneven, followed_s)


def _is_of_reading(episode: FaultEpisode) -> bool:
    """Whether what is left is errors of readings."""
    known = episode.isolation.hypotheses
    return all(known[name].fault.channel for name in episode.names())


@cache
def _of_another_unit(name: str) -> FaultModel:
    """What one thermocouple reads where a unit that is warmer has come with its fault."""
    free = {"low": -math.inf, "high": math.inf}
    sizes = Size("heating", "K/s", **free), Size("warmer", "K", **free)
    terms = Term(name, name_of(ELAPSED), 1.0, 0), Term(name, name_of(ONE), 1.0, 1)
    return FaultModel("heat", sizes, terms)


def _heats(knowledge: Knowledge) -> dict[str, FaultModel]:
    """What predicted stores are off by where a fault heats them, by their relations.

    By at most as much again as anything has in the recordings.
    """
    envelope = knowledge.calibration.envelope
    most = envelope.supplies if envelope else {}
    return {
        name: _heat(name, most.get(name, math.inf)) for name in knowledge.effects.residuals.of_unit
    }


def _heat(name: str, most: float) -> FaultModel:
    """A store that rises faster than predicted, since the detection."""
    size = Size("heating", "K/s", -most, most)
    return FaultModel("heat", (size,), (Term(name, name_of(ELAPSED), 1.0, 0),))
