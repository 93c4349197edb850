"""Residuals that are tested on a stand: those that its calibration has limits for."""

from __future__ import annotations

from flea_diag.core.calibration.calibration import Calibration
from flea_diag.core.residuals.residual_rows import ResidualRow, ResidualSet


def tested_names(known: ResidualSet, calibration: Calibration) -> list[str]:
    """Their names, in the order of the residuals."""
    return [row.name for row in known.rows if _is_tested(row, calibration)]


def _is_tested(row: ResidualRow, calibration: Calibration) -> bool:
    if row.gate == "sensor":
        return any(limit.has(row.name) for limit in calibration.sensors)
    return calibration.limit(row.name) is not None
