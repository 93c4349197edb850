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

"""Smallest sizes of faults that a motion shows: the information bound of its recordings.

The signals of healthy running are given. A fault of some size adds its effect to the residuals,
without noise, and the likelihood test of the isolator is applied to that expectation. Two sizes
are asked for: from which one on the fault explains the residuals better than no fault does, and
from which one on it stays ahead of every fault that can be told from it at all. No test of these
residuals does better on average; limits of tests, which also allow for what differs between
recordings, lie above it.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass
from itertools import groupby

from flea_diag.core.likelihood.fault_models import FaultModel, Size
from flea_diag.core.likelihood.fit import Fit
from flea_diag.core.likelihood.likelihood import NormalEquations

STEPS = 4
"""Bisections of a factor of two: sizes to within 5 %."""
DOUBLINGS = 12  # assumption: no bound beyond 4096 times what is detected
RESOLVED = 0.1
"""First size tried, in standard errors of the size."""


@dataclass(frozen=True)
class LikelihoodOf:
    """What the likelihood test of a stand rests on, beside the signals.

    ``sigma`` and ``correlation`` are the scatter of each residual and the samples to one
    independent one, ``tolerance`` what healthy units differ by. ``settled`` are residuals in which
    the unit has shown what it is by itself before the fault.
    """

    models: Sequence[FaultModel]
    sigma: Mapping[str, float]
    correlation: Mapping[str, float]
    tolerance: Sequence[float]
    explain_nats: float
    drop_nats: float
    settled: tuple[str, ...] = ()


@dataclass(frozen=True)
class SizeBound:
    """One size of one fault: from where on it is detected and isolated; infinity: at no size.

    ``group`` are the faults, itself included, that its largest size leaves.
    """

    fault: str
    size: Size
    detected_from: float
    isolated_from: float
    group: tuple[str, ...]


def size_bounds(
    evidence: NormalEquations,
    healthy: NormalEquations,
    test: LikelihoodOf,
    faults: Collection[str],
) -> tuple[SizeBound, ...]:
    """Bounds of every size of the first model of each of these faults, against all models.

    Parameters
    ----------
    evidence
        Signals of a motion as long as an episode; residuals without a fault are 0.
    healthy
        The same of the running before it, by which the unit is known.
    """
    found: list[SizeBound] = []
    for fault, models in groupby(test.models, key=lambda model: model.fault):
        if fault not in faults:
            continue
        first, *others = models
        search = _Search(evidence, healthy, test, first, [first, *others])
        found += [search.bound(index) for index in range(len(first.sizes)) if search.shows(index)]
        if not any(bound.fault == fault for bound in found):
            found.append(SizeBound(fault, first.sizes[0], math.inf, math.inf, ()))
    return tuple(found)


@dataclass(frozen=True)
class _Search:
    """One fault, in its first model, against its own models and those of all faults."""

    evidence: NormalEquations
    healthy: NormalEquations
    test: LikelihoodOf
    model: FaultModel
    own: Sequence[FaultModel]

    def shows(self, index: int) -> bool:
        """Whether this size moves a residual that was formed."""
        counts = dict(zip(self.evidence.residuals, self.evidence.samples, strict=True))
        terms = [term for term in self.model.terms if term.index == index]
        return any(counts.get(term.residual, 0.0) > 0.0 for term in terms)

    def bound(self, index: int) -> SizeBound:
        """Bounds of one size, the others at their smallest."""
        size, start = self.model.sizes[index], self._start(index)
        detected = self._smallest(size, start, lambda s: self._explains(index, s))
        if math.isinf(detected):
            return SizeBound(self.model.fault, size, math.inf, math.inf, ())
        largest = min(size.high, 2.0**DOUBLINGS * detected)
        group = self._left(index, largest)
        isolated = self._smallest(size, detected, lambda s: set(self._left(index, s)) <= set(group))
        return SizeBound(self.model.fault, size, detected, isolated, group)

    def _start(self, index: int) -> float:
        """A size far too small to be seen."""
        fit = self._fits([self.model], [0.0] * len(self.model.sizes))[0]
        error = fit.sigmas[index]
        return RESOLVED * error if 0.0 < error < math.inf else 0.0

    def _smallest(self, size: Size, start: float, holds: Callable[[float], bool]) -> float:
        """Smallest size from ``start`` on for which this holds; infinity: none within its limit."""
        low = max(start, size.low)
        if not 0.0 < low <= size.high:
            return math.inf
        if holds(low):
            return low
        for _ in range(DOUBLINGS):
            high = min(2.0 * low, size.high)
            if holds(high):
                return _bisected(low, high, holds)
            if high == size.high:
                break
            low = high
        return math.inf

    def _explains(self, index: int, value: float) -> bool:
        nats = max(fit.log_likelihood for fit in self._fits(self.own, self._sizes(index, value)))
        return nats >= self.test.explain_nats

    def _left(self, index: int, value: float) -> tuple[str, ...]:
        """Faults that this size of this fault leaves, best first."""
        best: dict[str, float] = {}
        fits = self._fits(self.test.models, self._sizes(index, value))
        for fit in fits:
            best[fit.fault] = max(fit.log_likelihood, best.get(fit.fault, -math.inf))
        leader = max(best.values())
        names = [name for name, nats in best.items() if leader - nats <= self.test.drop_nats]
        return tuple(sorted(names, key=lambda name: (-best[name], name)))

    def _sizes(self, index: int, value: float) -> list[float]:
        sizes = [max(size.low, 0.0) for size in self.model.sizes]
        sizes[index] = value
        return sizes

    def _fits(self, models: Sequence[FaultModel], sizes: Sequence[float]) -> tuple[Fit, ...]:
        """Fits of these models where the fault has these sizes."""
        test = self.test
        shown = self.evidence.showing(self.model, sizes)
        return shown.fit(
            models, test.sigma, test.correlation, test.tolerance, self.healthy, test.settled
        )


def _bisected(low: float, high: float, holds: Callable[[float], bool]) -> float:
    for _ in range(STEPS):
        middle = math.sqrt(low * high)
        low, high = (low, middle) if holds(middle) else (middle, high)
    return high
