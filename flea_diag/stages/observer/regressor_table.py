"""Basis signals of the fault models, one row for each scan."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from flea_diag.core.likelihood.effect_set import EffectSet
from flea_diag.core.residuals.parameters import ActuatorParameters
from flea_diag.core.residuals.relation_set import DIRECTION
from flea_diag.core.residuals.residual_rows import (
    INDEX,
    RESIDUAL_INDEX,
    TEMPERATURES,
    ResidualRows,
)
from flea_diag.core.symbolic.expression import FUNCTIONS

Array = npt.NDArray[np.float64]

MOTION_NAMES = ("speed_m_s", "moving")
"""Columns behind those of the basis: speed at the nut, and 1 where it moves or is stalled."""
_READ = np.array([INDEX[name] for name in TEMPERATURES])
_APART = np.array([RESIDUAL_INDEX[name] for name in TEMPERATURES])


class RegressorTable:
    """Basis signals of one unit, whose parameters change once its offsets are learned."""

    def __init__(self, effects: EffectSet, parameters: ActuatorParameters) -> None:
        self.names = (*effects.names, *MOTION_NAMES)
        self._p = parameters
        self._columns, self._arguments = (effects.functions[k] for k in ("columns", "shapes"))
        self._shapes = [FUNCTIONS[shape.name] for shape in effects.shapes.values()]
        self._signals = len(effects.relations.signals)
        self._lacking = effects.signals[self._signals + len(TEMPERATURES) + len(self._shapes) :]

    def adopt(self, parameters: ActuatorParameters) -> None:
        """Use other parameters from now on."""
        self._p = parameters

    def rows(self, rows: Array, residuals: ResidualRows) -> Array:
        """Columns of ``names``, shape (n, names)."""
        table = np.empty((len(rows), len(self.names)))
        # What each temperature should read; the reading itself shares the residual's noise.
        told = rows.take(_READ, axis=1) - residuals.values.take(_APART, axis=1)
        read = np.hstack((residuals.signals, told))
        x = read[0].tolist() if len(rows) == 1 else list(read.T)
        x += [f(a) for f, a in zip(self._shapes, self._arguments(self._p, x), strict=True)]
        x += [residuals.motion[:, 1] if s == DIRECTION else np.nan for s in self._lacking]
        found = self._columns(self._p, x)
        if len(rows) == 1:
            table[0, : len(found)] = found
        else:
            for number, column in enumerate(found):
                table[:, number] = column
        table[:, -2], table[:, -1] = residuals.speed_m_s, residuals.moving
        return table
