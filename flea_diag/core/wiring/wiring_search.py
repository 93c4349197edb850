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

One wiring explains them if without it all relations hold as on a healthy machine, in the first
readings as in the last. Those that explain about as well as the best one are named beside it, and
what a fault of the catalogue explains as well is not sure.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from flea_diag.core.calibration.calibration import Calibration
from flea_diag.core.frozen import Frozen
from flea_diag.core.likelihood.effect_set import EffectSet
from flea_diag.core.wiring.candidates import channels_of, lags, wiring_faults
from flea_diag.core.wiring.relation_check import Columns, Holding, RelationCheck
from flea_diag.core.wiring.wiring_fault import CLIPPED, WiringFault

Array = npt.NDArray[np.float64]
Scored = tuple[Holding, WiringFault]

LEAST_JUDGED, LEAST_UNCLIPPED = 0.5, 0.05
"""Share of the samples of a relation that must be left to judge it by."""
LEAST_STRETCHES = 8
"""Fewest averages of relations that tell one explanation from another by chance no more."""
ENOUGH_S = 1.0
"""Time of samples that is enough: a reading that is too large moves where the machine rests."""
BESIDE = 20.0
"""By how much more than those of the best the squares of another explanation may be."""
BETTER = 40.0
"""By how much less the squares must be than those of the readings as they are."""
SHOWN = 9.2
"""The same for the first readings alone, and beside a channel that says nothing: odds of a hundred
to one."""
LAGS = 15
"""About how many lags are tried before the best is looked for among its neighbours."""


@dataclass(frozen=True)
class WiringFinding(Frozen):
    """What explains readings that contradict the relations.

    ``residual`` is at ``share`` times its limit; without any one of ``faults`` none is beyond
    ``left`` times its limit. ``is_sure``: no fault of the catalogue explains them about as well.
    """

    faults: tuple[WiringFault, ...]
    residual: str
    share: float
    left: float
    is_sure: bool


class WiringSearch(Frozen):
    """Searches the wirings of one stand; ``columns`` are basis signals of its faults."""

    def __init__(self, effects: EffectSet, calibration: Calibration, columns: Columns) -> None:
        self._known, self._period_s = effects.residuals, calibration.period_s
        self._check = RelationCheck(effects, calibration, columns)
        self._enough = calibration.counts.of(ENOUGH_S)

    def hold(self, rows: Array) -> Holding:
        """How the relations hold on readings as they are, shape (n, channels)."""
        return self._check.hold(rows)

    def suspects(self, rows: Array, found: Holding) -> bool:
        """Whether some wiring explains readings on which relations hold so: worth more motion."""
        return not found.is_typical and any(True for _ in self._explaining(rows, found, SHOWN))

    def search(self, rows: Array, found: Holding, first: int) -> WiringFinding | None:
        """What explains readings on which relations hold so, the first so many of them as well."""
        if found.is_typical:
            return None
        early = self._check.hold(rows[:first])
        explaining = [
            (held, fault)
            for held, fault in self._explaining(rows, found, BETTER)
            if self._squares(rows[:first], early, fault) <= early.squares - SHOWN
            and held.squares <= self._silent(rows, fault) - SHOWN
        ]
        if not explaining:
            return None
        explaining.sort(key=lambda scored: scored[0].squares)
        best, least = explaining[0][0], explaining[0][0].squares
        faults = tuple(fault for held, fault in explaining if held.squares <= least + BESIDE)
        told = {f"{channel}_dead" for fault in faults for channel in fault.channels}
        every = self._check.left_by_faults(rows)
        rival = min((left for name, left in every.items() if name not in told), default=np.inf)
        is_sure = rival > least + BESIDE
        # Where all is within its limits and a fault would explain it as well, there is neither.
        if rival < least - BESIDE or not (is_sure or found.worst > 1.0):
            return None
        residual = self._known.rows[found.place].name
        return WiringFinding(faults, residual, found.worst, best.worst, is_sure)

    def _explaining(self, rows: Array, found: Holding, better: float) -> Iterator[Scored]:
        """Wirings without which all relations hold, by so much less in squares."""
        residuals = (self._known.rows[place].name for place in (found.place, found.raw_place))
        suspects = {channel for name in residuals for channel in channels_of(self._known, name)}
        for fault in self._suspected(rows, found, suspects):
            held = self._without(rows, found, fault)
            if held and held.is_typical and held.squares <= found.squares - better:
                yield held, fault

    def _suspected(
        self, rows: Array, found: Holding, suspects: Collection[str]
    ) -> Iterator[WiringFault]:
        """Wirings of these channels, of lags the best one of each."""
        yield from wiring_faults(self._known, rows, suspects)
        for channel in (name for name in self._known.channels if name in suspects):
            yield self._best(rows, found, lags(channel, self._period_s))

    def _silent(self, rows: Array, fault: WiringFault) -> float:
        """Squares where the channel says nothing: what is dead, or noise, explains no more."""
        return self._check.hold(fault.silent(rows, self._known.index)).squares

    def _best(self, rows: Array, found: Holding, every: list[WiringFault]) -> WiringFault:
        """The lag that leaves least."""
        left: Callable[[WiringFault], float] = lambda w: self._squares(rows, found, w)  # noqa: E731
        step = max(1, len(every) // LAGS)
        coarse = min(every[step - 1 :: step], key=left)
        near = [w for w in every if abs(w.scans - coarse.scans) < step]
        return min(near, key=left) if step > 1 else coarse

    def _squares(self, rows: Array, found: Holding, fault: WiringFault) -> float:
        held = self._without(rows, found, fault)
        return float("inf") if held is None else held.squares

    def _without(self, rows: Array, found: Holding, fault: WiringFault) -> Holding | None:
        """How the relations hold without it; None where too little is left to tell."""
        held = self._check.hold(fault.undone(rows, self._known.index))
        least = LEAST_UNCLIPPED if fault.kind == CLIPPED else LEAST_JUDGED
        needed = np.minimum(least * found.judged, self._enough)
        return held if np.all(held.judged >= needed) else None


def is_judged(held: Holding) -> bool:
    """Whether readings are enough to judge relations by."""
    return held.count >= LEAST_STRETCHES
