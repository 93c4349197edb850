"""Regressors of the fault models, one row for each scan."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from flea_diag.core.likelihood.fault_models import REGRESSORS
from flea_diag.core.likelihood.regressors import regressors
from flea_diag.core.residuals.parameters import ActuatorParameters
from flea_diag.core.residuals.residual_rows import (
    INDEX,
    RESIDUAL_INDEX,
    TEMPERATURES,
    ResidualRows,
)

Array = npt.NDArray[np.float64]

REGRESSOR_NAMES = (*REGRESSORS, "moving")
_READ = np.array([INDEX[name] for name in TEMPERATURES])
_APART = np.array([RESIDUAL_INDEX[name] for name in TEMPERATURES])


class RegressorTable:
    """Regressors of one unit, whose parameters change once its offsets are learned."""

    def __init__(self, parameters: ActuatorParameters) -> None:
        self._p = parameters

    def adopt(self, parameters: ActuatorParameters) -> None:
        """Use other parameters from now on."""
        self._p = parameters

    def rows(self, rows: Array, residuals: ResidualRows) -> Array:
        """Columns of ``REGRESSOR_NAMES``, shape (n, regressors)."""
        # What each temperature should read; the reading itself shares the residual's noise.
        apart = rows.take(_READ, axis=1) - residuals.values.take(_APART, axis=1)
        columns = apart[0].tolist() if len(rows) == 1 else apart.T
        expected = dict(zip(TEMPERATURES, columns, strict=True))
        found = regressors(self._p, residuals.signals, expected)
        table = np.empty((len(rows), len(REGRESSOR_NAMES)))
        table[:, -1] = residuals.moving
        if len(rows) == 1:
            table[0, :-1] = found
            return table
        for number, column in enumerate(found):
            table[:, number] = column
        return table
