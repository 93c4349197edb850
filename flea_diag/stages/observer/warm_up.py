"""Warm-up of a stream: the sensor offsets of this unit are learned once, at its start."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import numpy.typing as npt

from flea_diag.core.calibration.calibration import Calibration
from flea_diag.core.residuals.residual_rows import RESIDUAL_INDEX, SPREAD_ROWS, ResidualRows
from flea_diag.core.residuals.unit_offsets import OffsetLearning

Stamps = npt.NDArray[np.int64]
Offsets = Mapping[str, tuple[float, float]]
"""Unit parameter -> its change from the calibrated value, and the sigma of that."""

LEARNED = {
    "parity_mechanical": "current_offset_a",
    "parity_electrical": "voltage_offset_v",
}
"""Relation -> the offset of this unit that it fixes."""


class WarmUp:
    """Offset learning from the start of a stream until the warm-up time has passed."""

    def __init__(self, calibration: Calibration, warm_up_s: float, start_ns: int) -> None:
        self._calibration = calibration
        self._ends_ns = start_ns + round(warm_up_s * 1e9)
        self._learning = {
            residual: OffsetLearning(name, calibration.tolerance)
            for residual, name in LEARNED.items()
        }

    def leading(self, stamps_ns: Stamps) -> int:
        """How many of these scans may come in one block: the warm-up ends with a single one."""
        over = np.append(stamps_ns >= self._ends_ns, True)
        return int(over.argmax())  # the first: stamps may jump back after it

    def step(self, residuals: ResidualRows, stamp_ns: int, voltage_lost: bool) -> Offsets | None:
        """Learn from these scans; the offsets with the first scan after the warm-up.

        The zero of a voltage that is not trusted is not learned.
        """
        if stamp_ns >= self._ends_ns:
            return {
                LEARNED[residual]: learning.offset()
                for residual, learning in self._learning.items()
                if not (LEARNED[residual] == "voltage_offset_v" and voltage_lost)
            }
        self._learn(residuals)
        return None

    def _learn(self, residuals: ResidualRows) -> None:
        for name, learning in self._learning.items():
            limit = self._calibration.limit(name)
            if limit is not None:
                j = RESIDUAL_INDEX[name]
                values = residuals.values[residuals.moving, j]
                spread = residuals.spread[residuals.moving, SPREAD_ROWS.index(j)]
                learning.add(values, spread, limit.sigma[0] ** 2 * limit.correlation_samples)
