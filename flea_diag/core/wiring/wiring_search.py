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

"""Which wrong wiring, if any, explains that the relations of a stand do not hold.

One wiring explains them if without it all relations hold, for some healthy unit. Those that explain
about as well as the best one are named beside it.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from flea_diag.core.calibration.calibration import Calibration
from flea_diag.core.frozen import Frozen
from flea_diag.core.residuals.relation_set import RelationSet
from flea_diag.core.wiring.candidates import channels_of, lags, wiring_faults
from flea_diag.core.wiring.relation_check import Holding, RelationCheck
from flea_diag.core.wiring.wiring_fault import CLIPPED, FACTOR, WiringFault

Array = npt.NDArray[np.float64]
Scored = tuple[Holding, WiringFault]

LEAST_JUDGED, LEAST_UNCLIPPED = 0.5, 0.05
"""Share of the samples of a relation that must be left to judge it by."""
ENOUGH_S = 1.0
"""Time of samples that is enough: a reading that is too large moves where the machine rests."""
BESIDE = 20.0
"""By how much more than those of the best the squares of another wiring may be."""
BETTER = 40.0
"""By how much less the squares must be than those of the readings as they are."""
SHOWN = 9.2
"""The same for readings from before the first deviation: odds of a hundred to one."""
LAGS = 15
"""About how many lags are tried before the best is looked for among its neighbours."""


@dataclass(frozen=True)
class WiringFinding(Frozen):
    """What explains readings that contradict the relations.

    ``residual`` is at ``share`` times its limit; without any one of ``faults`` none is beyond
    ``left`` times its limit. ``is_sure``: they then hold as on a healthy machine.
    """

    faults: tuple[WiringFault, ...]
    residual: str
    share: float
    left: float
    is_sure: bool


@dataclass(frozen=True)
class SearchResult(Frozen):
    """Whether readings contradict the relations, and what explains it; None: nothing does."""

    contradicted: bool = False
    finding: WiringFinding | None = None


class WiringSearch(Frozen):
    """Searches the wirings of one stand."""

    def __init__(self, relations: RelationSet, calibration: Calibration) -> None:
        self._known, self._period_s = relations.residuals, calibration.period_s
        self._check = RelationCheck(relations, calibration)
        self._enough = calibration.counts.of(ENOUGH_S)

    def search(self, rows: Array, suspected: bool, before: int = 0) -> SearchResult:
        """What explains readings, shape (n, channels).

        ``suspected``: a test deviates, so wirings are tried as well where the relations hold, but
        not as they do on a healthy machine. ``before``: so many rows are from well before that;
        what is wired wrong shows in them, too.
        """
        found = self._check.hold(rows)
        if not found.count or (found.holds and not suspected) or found.is_typical:
            return SearchResult()
        # What is fitted to a unit may carry over into another relation.
        alike = self._check.hold(rows, fitted=False)
        residual, other = (self._known.rows[each.place].name for each in (found, alike))
        suspects = {*channels_of(self._known, residual), *channels_of(self._known, other)}
        every = self._explaining(rows, found, suspects)
        shown = (each for each in every if self._shows(rows[:before], each[1]))
        explaining = sorted(shown, key=lambda scored: scored[0].squares)
        if not explaining:
            return SearchResult(not found.holds)
        best = explaining[0][0]
        if found.holds and not best.is_typical:
            return SearchResult()
        faults = tuple(w for held, w in explaining if held.squares <= best.squares + BESIDE)
        finding = WiringFinding(
            faults, residual, float(found.share[found.place]), best.worst, best.is_typical
        )
        return SearchResult(True, finding)

    def _explaining(
        self, rows: Array, found: Holding, suspects: Collection[str]
    ) -> Iterator[Scored]:
        """Wirings of these channels without which all relations hold."""
        for fault in wiring_faults(self._known, rows, suspects):
            yield from self._tried(rows, found, fault)
        for channel in (name for name in self._known.channels if name in suspects):
            best = self._best(rows, found, lags(channel, self._period_s))
            yield from self._tried(rows, found, best)

    def _shows(self, rows: Array, fault: WiringFault) -> bool:
        """Whether readings from before any deviation are better explained by it as well."""
        if not len(rows):
            return True
        as_wired = self._check.hold(rows)
        without = self._without(rows, as_wired, fault)
        return without is not None and without.squares <= as_wired.squares - SHOWN

    def _best(self, rows: Array, found: Holding, every: list[WiringFault]) -> WiringFault:
        """The lag that leaves least."""
        step = max(1, len(every) // LAGS)
        coarse = min(every[step - 1 :: step], key=lambda w: self._squares(rows, found, w))
        near = [w for w in every if abs(w.scans - coarse.scans) < step]
        return min(near, key=lambda w: self._squares(rows, found, w)) if step > 1 else coarse

    def _squares(self, rows: Array, found: Holding, fault: WiringFault) -> float:
        held = self._without(rows, found, fault)
        return float("inf") if held is None else held.squares

    def _tried(self, rows: Array, found: Holding, fault: WiringFault) -> Iterator[Scored]:
        """The wiring, if it explains the readings."""
        held = self._without(rows, found, fault)
        if held is None or not held.holds or held.squares > found.squares - BETTER:
            return
        if fault.kind != FACTOR or held.squares <= self._silent(rows, fault) - BETTER:
            yield held, fault

    def _without(self, rows: Array, found: Holding, fault: WiringFault) -> Holding | None:
        """How the relations hold without it; None where too little is left to tell."""
        held = self._check.hold(fault.undone(rows, self._known.index))
        least = LEAST_UNCLIPPED if fault.kind == CLIPPED else LEAST_JUDGED
        needed = np.minimum(least * found.judged, self._enough)
        return held if np.all(held.judged >= needed) else None

    def _silent(self, rows: Array, fault: WiringFault) -> float:
        """Squares where the channel says nothing: a reading of next to nothing explains no more."""
        silent = rows.copy()
        column = self._known.index[fault.channel]
        silent[:, column] = np.nanmean(rows[:, column]) / fault.factor
        return self._check.hold(silent).squares
