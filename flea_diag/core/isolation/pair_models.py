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


"""Models of two faults at once: their effects add up, but for what a dead reading hides.

Where a reading is dead a relation that holds it says what it lacks in terms of the others: whatever
else is wrong, the one is the sum of the others. So no second fault acts on it, nor on a relation
that is void where no other reading tells whether a stop holds the part. Where a difference with
another reading says what is lacking, the other relations still show a fault that leaves this
difference alone.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

from flea_diag.core.faults.fault import Fault
from flea_diag.core.likelihood.fault_models import FaultModel, Size, Term, moved_by

Models = Mapping[str, Sequence[FaultModel]]
Pair = tuple[str, str]


def by_fault(models: Iterable[FaultModel]) -> dict[str, list[FaultModel]]:
    """Models of each fault that has any."""
    found: dict[str, list[FaultModel]] = {}
    for model in models:
        found.setdefault(model.fault, []).append(model)
    return found


@dataclass(frozen=True)
class Death:
    """What a dead reading hides: relations that hold it, and those that are void without it.

    ``told``: the difference that says what it should be; empty where each relation says so itself.
    """

    holding: frozenset[str]
    needing: frozenset[str]
    told: str

    def hides(self, fault: Sequence[FaultModel]) -> frozenset[str]:
        """Relations on which this fault does not act beside it."""
        apart = bool(self.told) and self.told not in moved_by(fault)
        return (frozenset({self.told}) if apart else self.holding) | self.needing


def deaths(
    faults: Mapping[str, Fault],
    models: Models,
    needed: Mapping[str, frozenset[str]],
    told: Mapping[str, str],
) -> dict[str, Death]:
    """Of each fault that is the death of a reading, by ``Stop.needed`` and ``EffectSet.told``."""
    return {
        name: Death(
            moved_by(known),
            needed.get(faults[name].channel, frozenset()),
            told.get(faults[name].channel, ""),
        )
        for name, known in models.items()
        # Of a single temperature nothing tells the truth: its death is no more than a bias.
        if faults[name].mode == "dead" and any(len(model.sizes) > 1 for model in known)
    }


class PairModels:
    """Models of each fault as the first and as the second of a pair."""

    def __init__(self, first: Models, second: Models, dead: Mapping[str, Death]) -> None:
        self._first, self._second, self._dead = first, second, dead
        self._hidden: dict[tuple[str, str, bool], list[FaultModel]] = {}

    def of(self, pair: Pair) -> tuple[Sequence[FaultModel], Sequence[FaultModel]]:
        """Models of both, without effects that the other one hides."""
        one, other = pair
        if one in self._dead:
            return self._first[one], self._beside(other, one, is_second=True)
        if other in self._dead:
            return self._beside(one, other, is_second=False), self._second[other]
        return self._first[one], self._second[other]

    def beside(self, fault: str, dead: str) -> Sequence[FaultModel]:
        """Models of a fault beside a dead reading; without sizes where that hides all effects."""
        if dead not in self._dead:  # it hides nothing by its sizes
            return self._second[fault]
        return self._beside(fault, dead, is_second=True)

    def _beside(self, fault: str, dead: str, is_second: bool) -> list[FaultModel]:
        key = fault, dead, is_second
        if key not in self._hidden:
            models = (self._second if is_second else self._first)[fault]
            hidden = self._dead[dead].hides(models)
            self._hidden[key] = [_without(model, hidden) for model in models]
        return self._hidden[key]


def _without(model: FaultModel, residuals: frozenset[str]) -> FaultModel:
    """The model in all other relations."""
    terms = tuple(term for term in model.terms if term.residual not in residuals)
    return replace(model, terms=terms) if terms else FaultModel(model.fault, (), ())


def together(*models: FaultModel) -> FaultModel:
    """Faults as one model: the sizes of the first, then those of the next."""
    sizes: tuple[Size, ...] = ()
    terms: list[Term] = []
    for model in models:
        terms += (Term(t.residual, t.regressor, t.gain, t.index + len(sizes)) for t in model.terms)
        sizes += model.sizes
    name = " and ".join(model.fault for model in models)
    return FaultModel(name, sizes, tuple(terms), max(model.roughness for model in models))


def delayed(model: FaultModel, elapsed: str, one: str, after_s: float) -> FaultModel:
    """The same fault, whose time counts from so long after the detection.

    ``elapsed`` and ``one`` name the basis signals of that time and of a constant.
    """
    later = tuple(
        Term(t.residual, one, -t.gain * after_s, t.index)
        for t in model.terms
        if t.regressor == elapsed
    )
    return replace(model, terms=model.terms + later)
