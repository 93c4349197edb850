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

"""Pairs of faults: two at once, or a second one beside the first.

Searched where no single fault explains an episode. Each deviation that was seen must be predicted,
by its sign, by one of both at least; a residual that looks normal rules out nothing. What both
explain together is known of all pairs from one system (``pair_gains``), and the best of them are
fitted like single faults are. A pair holds where it leaves no misfit, and where neither member can
do without the other: each predicts a deviation that the other does not, or explains what
the price of a second fault asks for, and takes away what the other leaves beyond noise.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import combinations, product

from flea_diag.core.faults.fault import Fault
from flea_diag.core.invariant import finite
from flea_diag.core.isolation.goodness_of_fit import GoodnessOfFit
from flea_diag.core.isolation.isolation import KNOWN
from flea_diag.core.isolation.pair_gains import pair_gains
from flea_diag.core.isolation.pair_models import Death, Models, Pair, PairModels, together
from flea_diag.core.likelihood.estimation import fitted
from flea_diag.core.likelihood.evidence_sums import EvidenceSums
from flea_diag.core.likelihood.fault_models import FaultModel
from flea_diag.core.likelihood.fit import Fit, KnownErrors
from flea_diag.core.likelihood.weighing import Weighing

Fitted = tuple[Fit, FaultModel, FaultModel]
"""Fit of a pair, and the models of both."""

SECOND_NATS = 10.0
"""Price of a second fault: in one of 20 000 episodes another comes up within the same minutes."""
SEEN_NATS = 3.0
"""What it must add where a deviation asks for it that the other does not predict."""
MOST_FITTED = 24
"""Pairs of faults that are fitted, the best by their gains."""
MOST_HELD = 8
"""Most pairs that make a verdict: beyond, the evidence says two faults and not which."""


@dataclass(frozen=True, slots=True)
class FaultPair:
    """Two faults that explain an episode together, the one that came first as the first.

    ``fits`` are the sizes of each with the log-likelihood of both.
    """

    faults: Pair
    fits: tuple[Fit, Fit]
    log_likelihood: float
    probability: float = math.nan


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
    is_possible
        Whether a fault of a fitted size is, by what its reading did at the onset.
    """

    predicted: Mapping[str, frozenset[str]]
    seen: frozenset[str]
    weighed: frozenset[str]
    firsts: Collection[str]
    is_possible: Callable[[Fault, Fit], bool]

    def ordered(self) -> list[Pair]:
        """All pairs, with one of ``firsts`` as the first."""
        pairs = list(combinations(self.predicted, 2))
        if not self.firsts:
            return pairs
        turned = [(b, a) for a, b in pairs if b in self.firsts and a not in self.firsts]
        return [(a, b) for a, b in pairs if a in self.firsts] + turned

    def cover(self, one: str, other: str) -> bool:
        """Whether two faults predict all that was seen."""
        return self.predicted[one] | self.predicted[other] >= self.seen

    def least(self, without: str) -> float:
        """Nats that the other must add to this one, for what this one does not predict."""
        left = self.seen - self.predicted[without]
        if left - self.weighed:
            return -math.inf
        return SEEN_NATS if left else math.inf


@dataclass(frozen=True, slots=True)
class Alone:
    """What one fault explains by itself, and what it leaves.

    ``is_poor``: whether that is a misfit. ``left``: relations of which it is more than noise,
    whatever the model of the fault may be off by.
    """

    nats: float
    is_poor: bool
    left: frozenset[str]

    def fits(self, beside: frozenset[str]) -> bool:
        """Whether it needs no second fault; ``beside``: of which a pair leaves more than noise.

        What a model is off by, no other fault takes away: where one does, it was that one's.
        """
        return not self.is_poor and self.left <= beside


class FaultPairs:
    """Finds pairs of faults of one catalogue."""

    def __init__(
        self, faults: Mapping[str, Fault], goodness: GoodnessOfFit, dead: Mapping[str, Death]
    ) -> None:
        self._faults, self._goodness, self._dead = faults, goodness, dead

    def search(
        self,
        sums: EvidenceSums,
        models: Models,
        later: Models,
        weighing: Weighing,
        clues: Clues,
        drop_nats: float,
        only: Sequence[Pair] = (),
    ) -> tuple[FaultPair, ...]:
        """Pairs that explain the evidence, the most probable first; none where none does.

        ``models`` are those of each fault as the first, ``later`` as the second of a pair;
        ``only`` these pairs are asked for, if any are given.
        """
        pairs = [p for p in only or clues.ordered() if clues.cover(*p)]
        both = PairModels(models, later, self._dead)
        joined = [
            (pair, one, other, together(one, other))
            for pair, best in _best(sums, pairs, both, weighing)
            for one in _alike(both.of(pair)[0], best[0])
            for other in _alike(both.of(pair)[1], best[1])
        ]
        if not joined:
            return ()
        fits = fitted(sums, [row[-1] for row in joined], weighing, once=True)
        found: dict[Pair, Fitted] = {}
        for (pair, one, other, _), fit in zip(joined, fits, strict=True):
            if pair not in found or fit.log_likelihood > found[pair][0].log_likelihood:
                found[pair] = fit, one, other
        return self._held(sums, found, models, weighing, clues, drop_nats)

    def _held(
        self,
        sums: EvidenceSums,
        found: Mapping[Pair, Fitted],
        models: Models,
        weighing: Weighing,
        clues: Clues,
        drop_nats: float,
    ) -> tuple[FaultPair, ...]:
        """Those near the best that leave nothing, and need both of their members."""
        possible = {
            pair: row for pair, row in found.items() if self._are_possible(pair, row, clues)
        }
        if not possible:
            return ()
        most = max(fit.log_likelihood for fit, _, _ in possible.values())
        near = {
            pair: row
            for pair, row in possible.items()
            if most - row[0].log_likelihood <= drop_nats + KNOWN**2 * max(most, 0.0)
        }
        nats, alone = self._alone(sums, near, models, weighing)
        left = {pair: self._beyond_noise(sums, pair, row[0]) for pair, row in near.items()}
        held = [
            FaultPair(pair, _members(row), nats[pair])
            for pair, row in near.items()
            if self._fits(sums, pair, row)
            and all(
                nats[pair] - alone[name].nats >= _price(name, alone[name], clues, left[pair])
                # Of a first fault that is known nothing need be shown again.
                for name in (pair[:1] if clues.firsts else pair)
            )
        ]
        if not held or len(held) > MOST_HELD:
            return ()
        return weighed(held)

    def _are_possible(self, pair: Pair, row: Fitted, clues: Clues) -> bool:
        return all(
            clues.is_possible(self._faults[name], fit)
            for name, fit in zip(pair, _members(row), strict=True)
        )

    def _fits(
        self,
        sums: EvidenceSums,
        pair: Pair,
        row: Fitted,
    ) -> bool:
        faults = [self._faults[name] for name in pair]
        return not self._goodness.misfits(sums, faults, row[0])

    def _alone(
        self,
        sums: EvidenceSums,
        near: Mapping[Pair, Fitted],
        models: Models,
        weighing: Weighing,
    ) -> tuple[dict[Pair, float], dict[str, Alone]]:
        """What each pair explains and what each member does alone, in the same weights."""
        names = tuple(dict.fromkeys(name for pair in near for name in pair))
        singles = [model for name in names for model in models[name] if model.sizes]
        joined = [together(one, other) for _, one, other in near.values()]
        fits = fitted(sums, [*joined, *singles], weighing, once=True)
        nats = dict.fromkeys(names, 0.0)
        for fit in fits[len(joined) :]:
            nats[fit.fault] = max(nats[fit.fault], fit.log_likelihood)
        pairs = zip(near, fits, strict=False)
        return (
            {pair: fit.log_likelihood for pair, fit in pairs},
            {name: self._by_itself(sums, models[name], nats[name], weighing) for name in names},
        )

    def _by_itself(
        self, sums: EvidenceSums, models: Sequence[FaultModel], nats: float, weighing: Weighing
    ) -> Alone:
        """What a fault leaves, in weights that no other fault has told."""
        known = [model for model in models if model.sizes]
        if not known:
            return Alone(nats, True, frozenset())
        best = max(fitted(sums, known, weighing), key=lambda fit: fit.log_likelihood)
        poor = self._goodness.misfits(sums, (self._faults[best.fault],), best)
        return Alone(nats, bool(poor), self._beyond_noise(sums, (best.fault,), best))

    def _beyond_noise(self, sums: EvidenceSums, names: Iterable[str], fit: Fit) -> frozenset[str]:
        return self._goodness.beyond_noise(sums, [self._faults[name] for name in names], fit)


def _price(name: str, alone: Alone, clues: Clues, beside: frozenset[str]) -> float:
    """Nats that another fault must add to this one: no end of them where this one fits.

    What a first fault left is known from before: since the second has begun, an unlikely unit may
    explain it as well.
    """
    fits = alone.fits(beside) and not clues.firsts
    return min(clues.least(name), math.inf if fits else SECOND_NATS)


def _best(
    sums: EvidenceSums,
    pairs: Sequence[Pair],
    both: PairModels,
    weighing: Weighing,
) -> list[tuple[Pair, tuple[FaultModel, FaultModel]]]:
    """The best pairs of faults by their gains, each with its best models."""
    columns: list[FaultModel] = []
    numbers: dict[int, list[int]] = {}
    whose = {
        (one, other): pair
        for pair in pairs
        for one, other in product(*(_numbers(columns, m, numbers) for m in both.of(pair)))
        if columns[one].sizes or columns[other].sizes
    }
    if not whose:
        return []
    found: dict[Pair, tuple[FaultModel, FaultModel]] = {}
    for row in pair_gains(sums, columns, list(whose), weighing):
        found.setdefault(whose[row.one, row.other], (columns[row.one], columns[row.other]))
        if len(found) == MOST_FITTED:
            break
    return list(found.items())


def _alike(models: Sequence[FaultModel], best: FaultModel) -> list[FaultModel]:
    """The models that differ from the best one in their roughness at most."""
    return [m for m in models if m.terms == best.terms and m.sizes == best.sizes]


def _numbers(
    columns: list[FaultModel], models: Sequence[FaultModel], numbers: dict[int, list[int]]
) -> list[int]:
    """Numbers of the models that differ in more than their roughness, new ones in ``columns``."""
    if id(models) not in numbers:
        start, known = len(columns), set()
        for model in models:
            if (key := (model.terms, model.sizes)) not in known:
                known.add(key)
                columns.append(model)
        numbers[id(models)] = list(range(start, len(columns)))
    return numbers[id(models)]


def _members(row: Fitted) -> tuple[Fit, Fit]:
    """The fit of both as fits of each."""
    fit, one, other = row
    count, sigmas = len(one.sizes), fit.sigmas
    parts = ((one.fault, slice(None, count)), (other.fault, slice(count, None)))
    first, second = (
        Fit(name, fit.log_likelihood, fit.sizes[part], KnownErrors(sigmas[part]))
        for name, part in parts
    )
    return first, second


def weighed(pairs: Sequence[FaultPair]) -> tuple[FaultPair, ...]:
    """With probabilities by equal priors, the most probable first."""
    finite("evidence of pairs", [pair.log_likelihood for pair in pairs])
    best = max(pair.log_likelihood for pair in pairs)
    weights = [math.exp(pair.log_likelihood - best) for pair in pairs]
    shares = [
        replace(pair, probability=weight / sum(weights))
        for pair, weight in zip(pairs, weights, strict=True)
    ]
    return tuple(sorted(shares, key=lambda pair: (-pair.probability, pair.faults)))


def members(pairs: Sequence[FaultPair]) -> dict[str, float]:
    """Probability of each fault to be one of both, the most probable first."""
    found: dict[str, float] = {}
    for pair in pairs:
        for name in pair.faults:
            found[name] = found.get(name, 0.0) + pair.probability
    return dict(sorted(found.items(), key=lambda item: (-item[1], item[0])))
