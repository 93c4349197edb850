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

"""Whether a hypothesis fits by itself: what it leaves is no more than healthy data show.

The most likely fault may still be a poor one. So the block means of each relation, without what the
fault and the unit account for, are held against the limit of such a mean, which the calibration has
learned out of sample. No mean of a healthy recording reaches it, so their root mean square does not
either, however much the noise of one motion differs from that of another. A relation that the fault
should move and that stays quiet counts as well as one that deviates by itself.

What a model leaves of a large fault is larger than any noise. A relation that the fault moves is
held against it only where more of it is left than the model may be off by: a drag scatters, while
of an error of a reading all is known but the size. Of a relation that it does not move nothing may
be left but noise, however much of it the unit accounts for. That a model may be off is said before
no other explanation: what a second fault takes away, the model of the first was not off by.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass
from types import MappingProxyType

from flea_diag.core.calibration.calibration import Calibration
from flea_diag.core.faults.fault import Fault
from flea_diag.core.likelihood.evidence_sums import EvidenceSums
from flea_diag.core.likelihood.fit import Fit
from flea_diag.core.likelihood.likelihood import FOLD

BLOCK_S = 0.5
"""Shortest time whose mean is held against nominal recordings."""
LEFT_OF_READING = 0.2
"""Share of a relation that the model of a reading's error may leave, as root mean squares.

An assumption: such an error adds to a relation what its mode says, and the gain is known to some
percent. On the simulated machines no true one left more than healthy recordings show."""
LEFT_OF_PLANT = math.sqrt(0.5)
"""The same of any other fault: no more than it explains, for the drag of a jam is not even."""


@dataclass(frozen=True, slots=True)
class Misfit:
    """A relation that a hypothesis does not fit.

    ``scatter`` is what is left of its means, in that of nominal recordings, and ``limit`` the most
    that is healthy.
    """

    residual: str
    scatter: float
    limit: float


@dataclass(frozen=True, slots=True)
class MeanScatter:
    """Means over ``BLOCK_S`` of one relation in nominal recordings: mean square, limit."""

    square: float
    k: float

    @classmethod
    def of(cls, calibration: Calibration, residual: str) -> MeanScatter | None:
        """By the test of the window nearest to a block; None without limits."""
        limit = calibration.limit(residual)
        if limit is None or not limit.windows:
            return None
        block = max(calibration.counts.of(BLOCK_S), FOLD)
        short = min(limit.windows, key=lambda row: abs(row.window - block))
        square = max(c**2 + s**2 for c, s in zip(short.centre, short.sigma, strict=True))
        return cls(square * max(short.window / block, 1.0), short.k)


Relations = Mapping[str, Collection[str]]
"""Of each fault."""


class GoodnessOfFit:
    """Holds what fits leave against nominal recordings.

    ``moved``: relations that a fault moves; ``heated``: those of them that no model says it of.
    """

    def __init__(
        self,
        calibration: Calibration,
        moved: Relations,
        heated: Relations = MappingProxyType({}),
    ) -> None:
        names = [limit.name for limit in calibration.limits]
        self._nominal = {name: MeanScatter.of(calibration, name) for name in names}
        self._moved, self._heated = moved, heated

    def left_by_all(
        self, sums: EvidenceSums, fits: Iterable[tuple[Fault, Fit | None]]
    ) -> tuple[Misfit, ...]:
        """What the first of several leaves, if no other fits either; one without a fit does."""
        found = []
        for fault, fit in fits:
            misfits = self.misfits(sums, (fault,), fit) if fit else ()
            if not misfits:
                return ()
            found.append(misfits)
        return found[0] if found else ()

    def exceeded_by_all(self, sums: EvidenceSums, fits: Iterable[tuple[Fault, Fit | None]]) -> bool:
        """Whether each of one or more leaves more than noise, whatever its model is off by."""
        return all(
            fit is not None and self.beyond_noise(sums, (fault,), fit) for fault, fit in fits
        )

    def beyond_noise(self, sums: EvidenceSums, faults: Iterable[Fault], fit: Fit) -> frozenset[str]:
        """Relations of which a fit leaves more than noise and heat, however large faults are."""
        left = self._left(sums, fit, self._shares(faults, self._heated))
        return frozenset(misfit.residual for misfit in left)

    def misfits(self, sums: EvidenceSums, faults: Iterable[Fault], fit: Fit) -> tuple[Misfit, ...]:
        """Relations that this fit of one or more faults does not explain, the worst first."""
        return self._left(sums, fit, self._shares(faults, self._moved))

    def _left(
        self, sums: EvidenceSums, fit: Fit, shares: Mapping[str, float]
    ) -> tuple[Misfit, ...]:
        """The same, where so much of each relation may be left."""
        found = []
        rows = zip(sums.residuals, sums.blocks, sums.shown, fit.left, strict=True)
        for name, blocks, shown, left in rows:
            nominal, share = self._nominal.get(name), shares.get(name, 0.0)
            if nominal is None or blocks < 1.0 or left < share**2 * shown:
                continue
            scatter = math.sqrt(left / (blocks * nominal.square))
            if scatter > nominal.k:
                found.append(Misfit(name, scatter, nominal.k))
        return tuple(sorted(found, key=lambda row: -row.scatter / row.limit))

    def _shares(self, faults: Iterable[Fault], moved: Relations) -> dict[str, float]:
        """What the models of these faults may leave of each relation that one of them moves."""
        found: dict[str, float] = {}
        for fault in faults:
            share = LEFT_OF_READING if fault.channel else LEFT_OF_PLANT
            for name in moved.get(fault.name, ()):
                found[name] = max(share, found.get(name, 0.0))
        return found
