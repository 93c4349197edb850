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

"""Windows of the law out of records of residuals."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

import numpy as np
import numpy.typing as npt

from flea_diag.core.evidence.stream_windows import LawScans, LawWindow, LawWindowMeans
from flea_diag.core.residuals.stop import Stop
from flea_diag.core.run_law.run_windows import PLACE
from flea_diag.wire.blocks import ResidualBlock

Array = npt.NDArray[np.float64]
Flags = npt.NDArray[np.bool_]


class StreamColumns:
    """Takes the residuals of the law, none that mean nothing at rest while it rests.

    Parameters
    ----------
    relations
        Of the law, in its order; ``in_motion`` are those that mean nothing at rest.
    signals, motion, travel, side, acting
        See ``LawWindowMeans``.
    slow
        Signals that are speeds, and what none of them exceeds at a standstill.
    stop
        Ends of travel, where a hard stop may push, and the relations that this enters.
    silent_at_ends
        Whether no relation says anything there.
    """

    def __init__(
        self, relations: tuple[str, ...], in_motion: frozenset[str], signals: tuple[str, ...],
        motion: tuple[str, str, str, str], slow: Mapping[str, float], stop: Stop,
        travel: tuple[float, ...], period_s: float, scans: int, side: str = "", *,
        acting: Flags, silent_at_ends: bool = False,
    ) -> None:  # fmt: skip
        self._relations, self._signals, self._motion = relations, signals, motion
        entered = relations if silent_at_ends else stop.reactions
        self._pushed = np.array([name in entered for name in relations], dtype=bool)
        self._gated = np.array([name in in_motion for name in relations], dtype=bool)
        self._period_s, self._scans = period_s, scans
        self._acting, self._slow, self._stop = acting, slow, stop
        self._travel, self._side = travel, side
        self._means: LawWindowMeans | None = None

    def add(self, block: ResidualBlock) -> Iterator[tuple[int, LawWindow]]:
        """Windows that these residuals complete, each with the number of its last scan."""
        scans = self.scans(block)
        return self._of(block).add(scans)

    def together(self, block: ResidualBlock) -> tuple[int, LawWindow]:
        """The same for all of them: number of the last scan of the first, and windows."""
        scans = self.scans(block)
        return self._of(block).together(scans)

    def scans(self, block: ResidualBlock) -> LawScans:
        """What windows are made of."""
        names = block.regressor_names
        values = block.values[:, [block.names.index(name) for name in self._relations]]
        resting = block.regressors[:, -1] <= 0.5
        pushed = self._stop.near(block.regressors[:, names.index(PLACE)])
        void = (resting[:, None] & self._gated) | (pushed[:, None] & self._pushed)
        values = np.where(void, np.nan, values)
        return LawScans(values, block.regressors, ~resting & self._stand(block))

    def means(self, names: tuple[str, ...], scans: int = 0) -> LawWindowMeans:
        """What makes windows of so many scans, 0: as they are, of tables of these regressors."""
        return LawWindowMeans(
            self._relations, self._signals, names, self._motion, self._acting, self._travel,
            self._period_s, scans or self._scans, self._side,
        )  # fmt: skip

    def _of(self, block: ResidualBlock) -> LawWindowMeans:
        if self._means is None:
            self._means = self.means(block.regressor_names)
        return self._means

    def _stand(self, block: ResidualBlock) -> Flags:
        """By either of two readings: which way its friction acts is known where both move."""
        places = [block.regressor_names.index(name) for name in self._slow]
        speeds = np.abs(block.regressors[:, places])
        return np.asarray((speeds <= np.array(list(self._slow.values()))).any(axis=1))
