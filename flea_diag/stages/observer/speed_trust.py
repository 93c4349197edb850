"""Trust in a speed that is the derivative of a position: a position step reads as a speed."""

from __future__ import annotations

import numpy as np

from flea_diag.core.conditions.lingering import Lingering
from flea_diag.core.residuals.residual import SPEED
from flea_diag.core.residuals.residual_rows import RESIDUAL_INDEX, RESIDUALS, ResidualRows
from flea_diag.core.sensors.position_step import SPAN
from flea_diag.core.smoothing import KERNEL_LENGTH

SPEED_SCANS = KERNEL_LENGTH + SPAN
"""Scans over which a position step shows as a speed."""
POSITION = RESIDUAL_INDEX["actuator_position"]
SPEED_COLUMNS = [j for j, row in enumerate(RESIDUALS) if SPEED in row.needs]


class SpeedTrust:
    """Drops residuals of the speed for as long as the kernel contains a position step."""

    def __init__(self, has_encoder: bool) -> None:
        self._has_encoder = has_encoder
        self._stepped = Lingering(SPEED_SCANS)

    def leave_out(self, residuals: ResidualRows) -> None:
        """Drop them in these scans; an encoder measures the speed itself and is left alone."""
        if self._has_encoder:
            return
        wrong = self._stepped.step(np.abs(residuals.values[:, POSITION]) > 1.0)
        if wrong is not None:
            residuals.leave_out(wrong, SPEED_COLUMNS)
            residuals.moving[wrong] = False
