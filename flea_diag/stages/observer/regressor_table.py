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

"""Basis signals of the fault models, one row for each scan."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from flea_diag.core.likelihood.effect_set import EffectSet
from flea_diag.core.residual_values import ResidualRows
from flea_diag.core.residuals.parameters import ActuatorParameters
from flea_diag.core.residuals.relation_set import DIRECTION
from flea_diag.core.run_law.run_windows import PLACE, answering, own_name, place_of
from flea_diag.core.symbolic.expression import FUNCTIONS, symbols

Array = npt.NDArray[np.float64]
Places = npt.NDArray[np.intp]

MOTION_NAMES = ("speed_m_s", "moving")
"""The last columns: speed at the nut, and 1 where it moves or is stalled."""


@dataclass(frozen=True, eq=False)
class Answer:
    """A signal that a relation answers by: what the rest of it says takes the place of the reading.

    ``column`` of the residual, ``signal`` and its ``gain`` there; ``places`` of the basis signals
    that hold it, ``names`` of what they become.
    """

    column: int
    signal: int
    gain: float
    places: Places
    names: tuple[str, ...]


def answers_of(
    effects: EffectSet, parameters: ActuatorParameters, relations: Sequence[str]
) -> tuple[Answer, ...]:
    """Answers of these relations, for the columns that the law of a recording takes."""
    return tuple(_answers(effects, parameters, tuple(relations)))


def _answers(
    effects: EffectSet, parameters: ActuatorParameters, relations: tuple[str, ...]
) -> Iterator[Answer]:
    rows, signals = effects.residuals, effects.relations.signals
    for place, signal, gain in answering(effects, parameters, relations):
        holds = {signals[signal]}
        holds |= {n for n, shape in effects.shapes.items() if holds & set(symbols(shape.argument))}
        places = [k for k, entry in enumerate(effects.basis) if holds & set(symbols(entry))]
        names = tuple(own_name(relations[place], effects.names[k]) for k in places)
        column = rows.columns([relations[place]])[0]
        yield Answer(column, signal, gain, np.array(places, dtype=np.intp), names)


class RegressorTable:
    """Basis signals of one unit, whose parameters change once its offsets are learned.

    With ``answers``, be there any or none, also the columns that the law of a recording takes.
    """

    def __init__(
        self, effects: EffectSet, parameters: ActuatorParameters,
        answers: Sequence[Answer] | None = None,
    ) -> None:  # fmt: skip
        jumps = tuple(f"jump_{name}" for name in effects.readings)
        own = tuple(name for answer in answers or () for name in answer.names)
        place = () if answers is None else (PLACE,)
        self.names = (*effects.names, *jumps, *own, *place, *MOTION_NAMES)
        self._answers, self._of_law = tuple(answers or ()), answers is not None
        self.jumps = slice(len(effects.names), len(effects.names) + len(jumps))
        """Columns that are left to be filled: how far each reading has just gone."""
        self._left = (math.nan,) * len(jumps)
        self._p = parameters
        self._columns, self._arguments = (effects.functions[k] for k in ("columns", "shapes"))
        self._shapes = [FUNCTIONS[shape.name] for shape in effects.shapes.values()]
        rows, temperatures = effects.residuals, effects.temperatures
        self._read = np.array([rows.index[name] for name in temperatures], dtype=int)
        self._apart = np.array(rows.predicted_columns, dtype=int)
        self._pairs = list(zip(self._read.tolist(), self._apart.tolist(), strict=True))
        self._residuals = rows
        self._signals = len(effects.relations.signals)
        self._lacking = effects.signals[self._signals + len(temperatures) + len(self._shapes) :]

    def adopt(self, parameters: ActuatorParameters) -> None:
        """Use other parameters from now on."""
        self._p = parameters

    def rows(self, rows: Array, residuals: ResidualRows) -> Array:
        """Columns of ``names``, shape (n, names), but for ``jumps``."""
        # What each temperature should read; the reading itself shares the residual's noise.
        if len(rows) == 1:
            pairs, read, apart = self._pairs, rows.item, residuals.values.item
            x = residuals.signals[0].tolist() + [read(0, k) - apart(0, j) for k, j in pairs]
            speed, way = residuals.motion[0].tolist()
            own = self._answered(x, way, residuals)
            own += [place_of(rows, self._residuals)[0]] if self._of_law else []
            found = (*self._basis(x, way), *self._left, *own, speed, float(residuals.moving[0]))
            return np.array((found,))
        told = rows.take(self._read, axis=1) - residuals.values.take(self._apart, axis=1)
        x = [*residuals.signals.T, *told.T]
        own = self._answered(x, residuals.motion[:, 1], residuals)
        own += [place_of(rows, self._residuals)] if self._of_law else []
        table = np.empty((len(rows), len(self.names)))
        for number, column in enumerate(self._basis(x, residuals.motion[:, 1])):
            table[:, number] = column
        for number, column in enumerate(own, start=self.jumps.stop):
            table[:, number] = column
        table[:, -2], table[:, -1] = residuals.speed_m_s, residuals.moving
        return table

    def _answered(self, x: list[Any], way: Any, residuals: ResidualRows) -> list[Any]:
        """Basis signals by what the rest of a relation says of the signal that it answers by."""
        found: list[Any] = []
        for answer in self._answers:
            told = list(x)
            apart = np.nan_to_num(residuals.values[:, answer.column]) / answer.gain
            told[answer.signal] = told[answer.signal] - (apart if len(apart) > 1 else apart[0])
            every = self._basis(told, way)
            found += [every[place] for place in answer.places]
        return found

    def _basis(self, x: list[Any], way: Any) -> tuple[Any, ...]:
        """Basis signals: numbers of one scan, or columns of many; ``way`` is the direction."""
        if self._shapes:
            arguments = self._arguments(self._p, x)
            x += [shape(value) for shape, value in zip(self._shapes, arguments, strict=True)]
        x += [way if name == DIRECTION else math.nan for name in self._lacking]
        found: tuple[Any, ...] = self._columns(self._p, x)
        return found
