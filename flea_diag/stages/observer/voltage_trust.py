"""Trust in a voltage channel that no second source corroborates."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from flea_diag.core.residuals.residual_rows import ResidualRows, ResidualSet
from flea_diag.core.scan_counts import ScanCounts
from flea_diag.core.sensors.plausibility import VoltagePlausibility

Flags = npt.NDArray[np.bool_]


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
        if not self.usable.all():
            residuals.leave_out(~self.usable, self.columns)


class VoltageTrust:
    """Cross-check of the voltage against current and motion."""

    def __init__(self, known: ResidualSet, limit_v: float, counts: ScanCounts) -> None:
        self._circuit = known.column(known.circuit)
        self.columns = known.needing(known.voltage)
        self._plausible = VoltagePlausibility(limit_v, counts)

    @property
    def lost(self) -> bool:
        """Whether the channel is not trusted now."""
        return self._plausible.bad

    def judge(self, residuals: ResidualRows, alone: Flags) -> VoltageVerdict:
        """Judge n scans; ``alone``, shape (n,), is where no command corroborates the voltage."""
        if self._circuit < 0:
            sure = np.ones(len(alone), dtype=bool)
            return VoltageVerdict(sure, sure, len(alone), self.columns)
        electrical = np.where(alone, residuals.values[:, self._circuit], np.nan)
        usable, was_bad = self._plausible.follow(electrical)
        lost_at = len(alone)
        if not usable.all():
            usable |= ~alone
            lost = np.append(was_bad[1:], self._plausible.bad) & ~was_bad
            lost_at = int(lost.argmax()) if lost.any() else lost_at
        return VoltageVerdict(usable, ~was_bad, lost_at, self.columns)
