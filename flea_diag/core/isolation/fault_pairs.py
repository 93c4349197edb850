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

Searched where no single fault explains an episode, or two explain far more. Each deviation that was
seen must be predicted, by its sign, by one of both at least; a residual that looks normal rules out
nothing. What both explain together is known of all pairs from one system (``pair_gains``), and the
best of them are fitted like single faults are. A pair holds where it leaves no misfit, and where no
member, nor any other fault that is left, does without it (``pair_clues``).
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import product

from flea_diag.core.faults.fault import Fault
from flea_diag.core.invariant import finite
from flea_diag.core.isolation.goodness_of_fit import GoodnessOfFit
from flea_diag.core.isolation.isolation import KNOWN
from flea_diag.core.isolation.pair_clues import APART_NATS, Alone, Clues
from flea_diag.core.isolation.pair_gains import pair_gains
from flea_diag.core.isolation.pair_models import Death, Models, Pair, PairModels, together
from flea_diag.core.likelihood.estimation import fitted
from flea_diag.core.likelihood.evidence_sums import EvidenceSums
from flea_diag.core.likelihood.fault_models import FaultModel, moved_by
from flea_diag.core.likelihood.fit import Fit, KnownErrors
from flea_diag.core.likelihood.weighing import Weighing

Fitted = tuple[Fit, FaultModel, FaultModel]
"""Fit of a pair, and the models of both."""

NONE = FaultModel("none", (), ())
"""No second fault."""
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


class FaultPairs:
    """Finds pairs of faults of one catalogue."""

    def __init__(
        self, faults: Mapping[str, Fault], goodness: GoodnessOfFit, dead: Mapping[str, Death]
    ) -> None:
        self._faults, self._goodness, self._dead = faults, goodness, dead

    def may_add(
        self, sums: EvidenceSums, models: Models, later: Models, weighing: Weighing, clues: Clues
    ) -> bool:
        """Whether a second fault may explain enough beside one of those that are left.

        In the weights of noise alone, which no misfit has lowered: no fit explains more.
        """
        both = PairModels(models, later, self._dead)
        columns, numbers = [NONE], dict[int, list[int]]()
        asked = [(k, 0) for name in clues.rivals for k in _numbers(columns, models[name], numbers)]
        for rival, other in product(clues.rivals, clues.predicted):
            if rival != other and clues.cover(rival, other):
                first, second = (_numbers(columns, m, numbers) for m in both.of((rival, other)))
                asked += [(one, two) for one in first for two in second]
        gains = pair_gains(sums, columns, asked, weighing)
        alone = max((row.nats for row in gains if row.other == 0), default=math.inf)
        return bool(gains) and gains[0].nats - alone >= clues.behind_nats(APART_NATS)

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
        nats, alone = self._alone(sums, near, models, weighing, clues)
        left = {pair: self._beyond_noise(sums, pair, row[0]) for pair, row in near.items()}
        shown = dict(
            zip(sums.residuals, (0.5 * weighing.weight * sums.square).tolist(), strict=True)
        )
        held = [
            FaultPair(pair, _members(row), nats[pair])
            for pair, row in near.items()
            if self._fits(sums, pair, row)
            and all(
                nats[pair] - alone[name].nats
                >= clues.price(alone[name], row[1:], left[pair], shown)
                # Of a first fault that is known nothing need be shown again.
                for name in (pair[:1] if clues.is_suspected else (*pair, *clues.rivals))
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
        clues: Clues,
    ) -> tuple[dict[Pair, float], dict[str, Alone]]:
        """What each pair explains, each member and rival alone, in the same weights."""
        names = tuple(dict.fromkeys((*(name for pair in near for name in pair), *clues.rivals)))
        singles = [model for name in names for model in models[name] if model.sizes]
        warm = [together(model, *clues.heating(models[model.fault])) for model in singles]
        joined = [together(one, other) for _, one, other in near.values()]
        fits = fitted(sums, [*joined, *singles, *warm], weighing, once=True)
        nats, heated = dict.fromkeys(names, 0.0), dict.fromkeys(names, 0.0)
        found = [fit.log_likelihood for fit in fits[len(joined) :]]
        of_singles, of_warm = found[: len(singles)], found[len(singles) :]
        for model, cold, hot in zip(singles, of_singles, of_warm, strict=True):
            nats[model.fault] = max(nats[model.fault], cold)
            heated[model.fault] = max(heated[model.fault], cold, hot)
        pairs = zip(near, fits, strict=False)
        alone = {n: self._by_itself(sums, n, models[n], nats[n], weighing) for n in names}
        return (
            {pair: fit.log_likelihood for pair, fit in pairs},
            {n: replace(each, heated=heated[n]) for n, each in alone.items()},
        )

    def _by_itself(
        self,
        sums: EvidenceSums,
        name: str,
        models: Sequence[FaultModel],
        nats: float,
        weighing: Weighing,
    ) -> Alone:
        """What a fault leaves, in weights that no other fault has told."""
        known = [model for model in models if model.sizes]
        if not known:
            return Alone(name, nats, True, frozenset(), frozenset())
        best = max(fitted(sums, known, weighing), key=lambda fit: fit.log_likelihood)
        poor = self._goodness.misfits(sums, (self._faults[name],), best)
        left = self._beyond_noise(sums, (name,), best)
        return Alone(name, nats, bool(poor), left, moved_by(known))

    def _beyond_noise(self, sums: EvidenceSums, names: Iterable[str], fit: Fit) -> frozenset[str]:
        return self._goodness.beyond_noise(sums, [self._faults[name] for name in names], fit)


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
