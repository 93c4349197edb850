"""Basis signals of the fault models, one row for each scan."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import numpy.typing as npt

from flea_diag.core.likelihood.effect_set import EffectSet
from flea_diag.core.residuals.parameters import ActuatorParameters
from flea_diag.core.residuals.relation_set import DIRECTION
from flea_diag.core.residuals.residual_rows import ResidualRows
from flea_diag.core.symbolic.expression import FUNCTIONS

Array = npt.NDArray[np.float64]

MOTION_NAMES = ("speed_m_s", "moving")
"""The last columns: speed at the nut, and 1 where it moves or is stalled."""


class RegressorTable:
    """Basis signals of one unit, whose parameters change once its offsets are learned."""

    def __init__(self, effects: EffectSet, parameters: ActuatorParameters) -> None:
        jumps = tuple(f"jump_{name}" for name in effects.readings)
        self.names = (*effects.names, *jumps, *MOTION_NAMES)
        self.jumps = slice(len(effects.names), len(effects.names) + len(jumps))
        """Columns that are left to be filled: how far each reading has just gone."""
        self._left = (math.nan,) * len(jumps)
        self._p = parameters
        self._columns, self._arguments = (effects.functions[k] for k in ("columns", "shapes"))
        self._shapes = [FUNCTIONS[shape.name] for shape in effects.shapes.values()]
        rows, temperatures = effects.residuals, effects.temperatures
        self._read = np.array([rows.index[name] for name in temperatures], dtype=int)
        self._apart = np.array(rows.predicted_columns, dtype=int)
        self._signals = len(effects.relations.signals)
        self._lacking = effects.signals[self._signals + len(temperatures) + len(self._shapes) :]

    def adopt(self, parameters: ActuatorParameters) -> None:
        """Use other parameters from now on."""
        self._p = parameters

    def rows(self, rows: Array, residuals: ResidualRows) -> Array:
        """Columns of ``names``, shape (n, names), but for ``jumps``."""
        # What each temperature should read; the reading itself shares the residual's noise.
        told = rows.take(self._read, axis=1) - residuals.values.take(self._apart, axis=1)
        if len(rows) == 1:
            x = residuals.signals[0].tolist() + told[0].tolist()
            speed, way = residuals.motion[0].tolist()
            found = (*self._basis(x, way), *self._left, speed, float(residuals.moving[0]))
            return np.array((found,))
        x = [*residuals.signals.T, *told.T]
        table = np.empty((len(rows), len(self.names)))
        for number, column in enumerate(self._basis(x, residuals.motion[:, 1])):
            table[:, number] = column
        table[:, -2], table[:, -1] = residuals.speed_m_s, residuals.moving
        return table

    def _basis(self, x: list[Any], way: Any) -> tuple[Any, ...]:
        """Basis signals: numbers of one scan, or columns of many; ``way`` is the direction."""
        if self._shapes:
            arguments = self._arguments(self._p, x)
            x += [shape(value) for shape, value in zip(self._shapes, arguments, strict=True)]
        x += [way if name == DIRECTION else math.nan for name in self._lacking]
        found: tuple[Any, ...] = self._columns(self._p, x)
        return found
