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

"""What speaks of a pair of faults beside its fit, and what it must add to a fault by itself.

Either of both must predict a deviation that the other does not, or the pair explains so much more
than the other alone: where that leaves more than noise, or what the pair takes away, the price of a
second fault, and else as well what the model of a single one may lack.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Iterable, Mapping
from dataclasses import dataclass, field
from itertools import combinations

from flea_diag.core.faults.fault import Fault
from flea_diag.core.isolation.isolation import KNOWN
from flea_diag.core.isolation.pair_models import Pair
from flea_diag.core.likelihood.fault_models import FaultModel, moved_by
from flea_diag.core.likelihood.fit import Fit

SECOND_NATS = 10.0
"""Price of a second fault: in one of 20 000 episodes another comes up within the same minutes."""
BEHIND_NATS = 50.0
"""What a second fault must add to one that leaves no more than healthy recordings show, beside
``KNOWN`` squared, in ``BEHIND_S`` of evidence: the model of a fault may lack as much. Of 281 single
faults on the simulated machines the worst was 22 behind a pair, apart from temperatures."""
APART_NATS = 25.0
"""The same where the two act on no relation in common: there the model of the first lacks nothing.
Of 156 single faults on the simulated machines the worst was 14 behind such a pair, but for one of
45 in the balance of forces, whose friction goes on changing."""
BEHIND_S = 30.0
"""As long those were followed. What a model lacks comes again with each stroke."""
SEEN_NATS = 3.0
"""What it must add where a deviation asks for it that the other does not predict."""


@dataclass(frozen=True, eq=False)
class Clues:
    """What speaks of a pair beside the relations.

    Attributes
    ----------
    predicted
        Of each fault that is possible the deviations that it predicts.
    seen
        All deviations.
    weighed
        Those of relations, whose size is weighed; the tests of single sensors speak for themselves.
    firsts
        Faults of which one is the first; empty: any.
    rivals
        Faults that are left: no pair holds that adds too little to one of them.
    heats
        Of each relation that predicts a slow store of the unit, as a temperature, what it is off by
        where a fault heats that by no model.
    uneven
        Relations that keep no level throughout a run, as that with the friction.
    followed_s
        Time for which faults that began then have been followed.
    is_possible
        Whether a fault of a fitted size is, by what its reading did at the onset.
    """

    predicted: Mapping[str, frozenset[str]]
    seen: frozenset[str]
    weighed: frozenset[str]
    firsts: Collection[str]
    is_possible: Callable[[Fault, Fit], bool]
    rivals: Collection[str] = ()
    heats: Mapping[str, FaultModel] = field(default_factory=dict)
    uneven: frozenset[str] = frozenset()
    followed_s: float = 0.0

    def behind_nats(self, nats: float = BEHIND_NATS) -> float:
        """What a second fault must add to one that leaves no more than healthy recordings show."""
        return nats * max(1.0, self.followed_s / BEHIND_S)

    @property
    def is_suspected(self) -> bool:
        """Whether a second fault is looked for since the first, by itself, explains no more."""
        return bool(self.firsts) and not self.rivals

    def ordered(self) -> list[Pair]:
        """All pairs, with one of ``firsts`` as the first."""
        pairs = list(combinations(self.predicted, 2))
        if not self.firsts:
            return pairs
        turned = [(b, a) for a, b in pairs if b in self.firsts and a not in self.firsts]
        return [(a, b) for a, b in pairs if a in self.firsts] + turned

    def cover(self, one: str, other: str) -> bool:
        """Whether two faults are possible still, and predict all that was seen."""
        known = self.predicted
        return {one, other} <= known.keys() and known[one] | known[other] >= self.seen

    def heating(self, models: Iterable[FaultModel]) -> list[FaultModel]:
        """What stores heat by that none of these models of one fault says."""
        moved = moved_by(models)
        return [heat for name, heat in self.heats.items() if name not in moved]

    def least(self, without: str) -> float:
        """Nats that the other must add to this one, for what this one does not predict."""
        left = self.seen - self.predicted[without]
        if left - self.weighed:
            return -math.inf
        return SEEN_NATS if left else math.inf

    def price(
        self,
        alone: Alone,
        both: Iterable[FaultModel],
        beside: frozenset[str],
        shown: Mapping[str, float],
    ) -> float:
        """Nats that a pair of ``both`` must add to this fault; ``beside``: see ``Alone.fits``.

        ``shown`` are the nats that there are in each relation: what the model of a fault may be
        off by is a share of what it explains where the other one acts, and of nothing else.
        Whatever alters a motion heats or cools a store by what no model says: a second fault there
        must add as much to what that may explain.
        What a first fault left is known from before: since the second has begun, an unlikely unit
        may explain it as well.
        """
        asked = self.least(alone.name)
        if self.is_suspected or not alone.fits(beside):
            return min(asked, SECOND_NATS)
        unmoved = self.heats.keys() - alone.moved
        others = [model for model in both if model.fault != alone.name]
        if any(moved_by([model]) <= unmoved for model in others):
            return min(asked, self.behind_nats() + alone.heated - alone.nats)
        acts = moved_by(others)
        unsure = bool(acts & (alone.moved | self.uneven))
        behind = self.behind_nats(BEHIND_NATS if unsure else APART_NATS)
        there = min(alone.nats, sum(shown.get(name, 0.0) for name in acts))
        return min(asked, behind + KNOWN**2 * max(there, 0.0))


@dataclass(frozen=True, slots=True)
class Alone:
    """What one fault explains by itself, and what it leaves.

    ``is_poor``: whether that is a misfit. ``left``: relations of which it is more than noise,
    whatever the model of the fault may be off by. ``moved``: those that its models move.
    ``heated``: the nats, where it heats stores by what no model says.
    """

    name: str
    nats: float
    is_poor: bool
    left: frozenset[str]
    moved: frozenset[str]
    heated: float = -math.inf

    def fits(self, beside: frozenset[str]) -> bool:
        """Whether it needs no second fault; ``beside``: of which a pair leaves more than noise.

        What a model is off by, no other fault takes away: where one does, it was that one's.
        """
        return not self.is_poor and self.left <= beside
