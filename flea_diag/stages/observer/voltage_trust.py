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

"""Trust in a voltage channel that no second source corroborates."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from flea_diag.core.residual_values import ResidualRows
from flea_diag.core.residuals.residual_rows import ResidualSet
from flea_diag.core.scan_counts import ScanCounts
from flea_diag.core.sensors.plausibility import VoltagePlausibility

Array = npt.NDArray[np.float64]
Flags = npt.NDArray[np.bool_]

SURE: Flags = np.ones(1, dtype=bool)
SURE.setflags(write=False)
"""Of one scan whose voltage is trusted."""


class VoltageVerdict(NamedTuple):
    """Trust in the voltage over n scans.

    ``usable``: which scans may use the voltage, shape (n,). ``trusted``: whether the channel was
    trusted before each scan, shape (n,). ``lost_at``: the first scan with which it lost that
    trust, or n; the windows of a stream forget the voltage from there on, so later rows of the
    same block do not count. ``columns``: the residuals that need the voltage.
    """

    usable: Flags
    trusted: Flags
    lost_at: int
    columns: list[int]

    def leave_out(self, residuals: ResidualRows) -> None:
        """Drop the residuals that need the voltage where it must not be used."""
        if np.count_nonzero(self.usable) < len(self.usable):
            residuals.leave_out(~self.usable, self.columns)


class VoltageTrust:
    """Cross-check of the voltage against current and motion."""

    def __init__(self, known: ResidualSet, limit_v: float, counts: ScanCounts) -> None:
        self._circuit, self._channel = known.column(known.circuit), known.channel(known.voltage)
        self.columns = known.needing(known.voltage)
        self._plausible = VoltagePlausibility(limit_v, counts)
        self._held: Flags | None = None

    @property
    def lost(self) -> bool:
        """Whether the channel is not trusted now."""
        return self._plausible.bad

    def withhold(self, given: Array, usable: Array) -> None:
        """Which of the next scans had their voltage withheld, both of shape (n, channels).

        A voltage that stands still where nothing corroborates it is as bad as one that contradicts.
        """
        if self._circuit >= 0 and self._channel >= 0:
            gone = np.isnan(usable[:, self._channel])
            if np.count_nonzero(gone):
                self._held = gone & ~np.isnan(given[:, self._channel])

    def judge(self, residuals: ResidualRows, alone: Flags | None) -> VoltageVerdict:
        """Judge n scans; ``alone``, shape (n,), is where no command corroborates the voltage."""
        lost_at = len(residuals)
        held, self._held = self._held, None
        if self._circuit < 0 or (alone is None and not self.lost):
            sure = SURE if lost_at == 1 else np.ones(lost_at, dtype=bool)
            return VoltageVerdict(sure, sure, lost_at, self.columns)
        alone = np.zeros(lost_at, dtype=bool) if alone is None else alone
        electrical = np.where(alone, residuals.values[:, self._circuit], np.nan)
        if held is not None:
            electrical[held & alone] = np.inf
        usable, was_bad = self._plausible.follow(electrical)
        if not usable.all():
            usable |= ~alone
            lost = np.append(was_bad[1:], self._plausible.bad) & ~was_bad
            lost_at = int(lost.argmax()) if lost.any() else lost_at
        return VoltageVerdict(usable, ~was_bad, lost_at, self.columns)
