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

"""What healthy recordings differ by in the relations, as columns of a design.

Of three kinds: parameters of the *unit*; what is *free* in each run, such as the zeros of sensors
and how warm a part was before; and what the relations *neglect*: friction that grows with the
load, a rest of the direction, the rate of the current, zero and gain of two readings of one. A
signal whose coefficient in a balance holds no parameter is the one that the balance is trusted by:
were it a column, zero would fit.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from flea_diag.core.likelihood.effect_set import EffectSet, motion_signals, name_of
from flea_diag.core.likelihood.effects import EffectRules
from flea_diag.core.residuals.parameters import UNIT_PARAMETERS, ZEROS, ActuatorParameters
from flea_diag.core.residuals.relation_set import DIRECTION, CompiledRelation
from flea_diag.core.run_law.run_windows import (
    BY_PLACE,
    CURRENT_HEAT,
    CURRENT_RATE,
    CURRENT_WAY,
    CURRENT_ZERO,
    LOAD_BY_PLACE,
    LOAD_DRAG,
    REVERSAL,
    WAY_BY_PLACE,
    WINDOW_S,
    RunWindows,
    current_side,
    signal_names,
    speed_signal,
)
from flea_diag.core.symbolic.collect import collect
from flea_diag.core.symbolic.expression import (
    Constant,
    Variable,
    derivative,
    evaluate,
    symbols,
)

Array = npt.NDArray[np.float64]

UNIT, FREE, NEGLECTED = "unit", "free", "neglected"
ONE = "one"
LEAST = 1e-5
"""Tolerances below are those of what a description takes as equal in all units."""


@dataclass(frozen=True)
class LawColumn:
    """One column: ``tolerance`` is what units differ by, one sigma; NaN of what is neglected.

    ``relation`` is that of a neglected term; empty: the column enters several.
    """

    name: str
    kind: str
    tolerance: float
    relation: str = ""


@dataclass(frozen=True, eq=False)
class LawColumns:
    """Columns of these relations; ``design`` has shape (relations, signals, columns).

    ``elapsed`` is the place of the time since the start among the signals.
    """

    relations: tuple[str, ...]
    columns: tuple[LawColumn, ...]
    design: Array
    elapsed: int

    def __len__(self) -> int:
        return len(self.columns)

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the columns."""
        return tuple(column.name for column in self.columns)

    def of(self, run: RunWindows) -> Array:
        """What one unit of each column adds, shape (windows, relations, columns)."""
        added = np.einsum("trs,rsc->trc", run.signals, self.design)
        since_s = (np.arange(len(run)) + 0.5) * WINDOW_S
        return np.asarray(added + since_s[:, None, None] * self.design[:, self.elapsed])

    def some(self, which: Sequence[int]) -> LawColumns:
        """The same with some of the columns, in this order."""
        places = list(which)
        kept = tuple(self.columns[place] for place in places)
        return LawColumns(self.relations, kept, self.design[..., places], self.elapsed)


def law_columns(
    effects: EffectSet,
    parameters: ActuatorParameters,
    tolerance: Mapping[str, float],
    relations: tuple[str, ...],
    free: Collection[str] = (),
) -> LawColumns:
    """Columns of these relations.

    Parameters
    ----------
    tolerance
        By ``EffectSet.differences``, one sigma in SI units.
    free
        Parameters that the description marks as free in each run, beside the zeros.
    """
    names = signal_names(effects)
    entries: dict[LawColumn, Array] = {}
    for column, place, gain in _terms(effects, parameters, tolerance, {*ZEROS, *free}):
        if place[0] in relations and place[1] in names:
            blank = np.zeros((len(relations), len(names)))
            entry = entries.setdefault(column, blank)
            entry[relations.index(place[0]), names.index(place[1])] += gain
    blank = np.zeros((len(relations), len(names), 0))
    design = np.stack(list(entries.values()), axis=-1) if entries else blank
    return LawColumns(relations, tuple(entries), design, names.index("elapsed_s"))


def dry_friction(
    effects: EffectSet, parameters: ActuatorParameters, relations: tuple[str, ...]
) -> Array:
    """What all of the dry friction holds of each signal, shape (relations, signals)."""
    names, values = signal_names(effects), _values(parameters)
    held = np.zeros((len(relations), len(names)))
    rules = EffectRules(effects.relations)
    for row in effects.relations.relations:
        if row.name != effects.residuals.friction or row.name not in effects.residuals.in_motion:
            continue
        rubbing = (n for n in symbols(derivative(row.expression, DIRECTION)) if n in values)
        for name in rubbing:
            for effect in rules.moved({name: Constant(values[name])}):
                place = effect.residual, name_of(effect.basis)
                if place[0] in relations and place[1] in names:
                    gain = float(evaluate(effect.gain, values))
                    held[relations.index(place[0]), names.index(place[1])] += gain
    return held


Term = tuple[LawColumn, tuple[str, str], float]
"""A column, the relation and the signal by which it enters it, and the factor."""


def _terms(
    effects: EffectSet,
    parameters: ActuatorParameters,
    tolerance: Mapping[str, float],
    free: Collection[str],
) -> Iterator[Term]:
    rules, values = EffectRules(effects.relations), _values(parameters)
    for name in UNIT_PARAMETERS:
        if tolerance.get(name, 0.0) < LEAST:
            continue
        column = LawColumn(name, FREE if name in free else UNIT, tolerance[name])
        for effect in rules.moved({name: Constant(-1.0)}):
            gain = float(evaluate(effect.gain, values))
            yield column, (effect.residual, name_of(effect.basis)), gain
    for term in effects.basis_of(parameters).unit_terms:
        # Predictions follow no sensor in a recording: none has lagged behind when it begins.
        if term.difference not in UNIT_PARAMETERS and term.regressor != ONE:
            column = LawColumn(term.difference, FREE, tolerance[term.difference])
            yield column, (term.residual, term.regressor), term.gain
    yield from _neglected(effects)


def _neglected(effects: EffectSet) -> Iterator[Term]:
    """Columns of one relation each."""
    circuit = effects.residuals.circuit
    for row in effects.relations.relations:
        signals = [CURRENT_RATE, CURRENT_HEAT] if row.name == circuit else []
        of_row = (*_loads(row, effects), *_pushes(row, effects), *_of_pair(row, effects))
        for signal in (*signals, *of_row):
            yield _own(row.name, signal)
    for name in effects.residuals.predictions:
        yield _own(name, ONE)


def _own(relation: str, signal: str) -> Term:
    column = LawColumn(f"{relation}: {signal}", NEGLECTED, float("nan"), relation)
    return column, (relation, signal), 1.0


def _loads(row: CompiledRelation, effects: EffectSet) -> Iterator[str]:
    """Load, load times sign of the motion and sign of the motion, where they are no term of it.

    Also how load and friction change along the stroke; where nothing reads the load, what it is
    there: a payload's weight turns with the link, a cable pulls.
    """
    if row.kind != "junction":
        return
    load = motion_signals(effects.residuals)[1]
    if row.name != effects.residuals.circuit:
        yield REVERSAL
        if effects.residuals.position:
            yield from LOAD_BY_PLACE if load in effects.relations.signals else BY_PLACE
            yield from WAY_BY_PLACE
    if load in effects.relations.signals:
        yield LOAD_DRAG
        if not _trusted(row, load, effects):
            yield load
    if DIRECTION in effects.names and DIRECTION not in row.signals:
        yield DIRECTION


def _pushes(row: CompiledRelation, effects: EffectSet) -> Iterator[str]:
    """Of a balance of power what a steady push takes, which no channel reads."""
    speed = speed_signal(effects.residuals)
    if row.kind == "power" and speed in effects.names:
        yield speed


def _of_pair(row: CompiledRelation, effects: EffectSet) -> Iterator[str]:
    """Zero and gain of one reading against the other, where they are no term of the difference.

    The voltage of a bridge loses some by the way that its current goes, and some in its resistance.
    Where the description names the bridge, the former follows the reading of the current, whose
    zero is not known exactly.
    """
    if row.kind == "difference":
        yield ONE
        yield from (name for name in row.pair[1:] if name in effects.names)
        if effects.residuals.voltage in row.pair:
            yield CURRENT_WAY
            if effects.residuals.current in effects.names:
                yield effects.residuals.current
            if current_side(effects) in row.signals:
                yield CURRENT_ZERO


def _trusted(row: CompiledRelation, signal: str, effects: EffectSet) -> bool:
    """Whether the relation holds the signal with a coefficient without a parameter."""
    share = collect(row.expression, effects.relations.signals).get(Variable(signal))
    return share is not None and not symbols(share)


def _values(parameters: ActuatorParameters) -> dict[str, float]:
    return {name: getattr(parameters, name) for name in parameters.__dataclass_fields__}
