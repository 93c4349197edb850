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

"""State equations of the driven model, from the relations of the bond graph.

Every relation leaves one quantity open that the others do not: the balance of the motor circuit the
current, the balance of forces the acceleration, two readings of one motion each other. Solved for
it, the relations are what sensors read and how fast the motion changes (Narasimhan et al. 2010,
section 4.1), in base parameters. For the FLEA at its nut:

    i   = i0 + (V - V0 - Ke v) / R(T)
    M v' = K (i - i0) - (fc + c|F|) s(v) - B v - F           s(v) = tanh(v / v_s)
    x'  = v

Terms with a shape, such as the smooth sign, are friction; all else is linear, and its coefficients
are numbers as long as parameters and winding temperature are. Readings are taken as of one rigid
part: what lies between two of them, and follows the load, is left out.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property, lru_cache
from types import FunctionType
from typing import Any

import numpy as np

from flea_diag.core.frozen import Frozen
from flea_diag.core.residuals.measured_graph import channel_of, rate_symbol, time_derivative
from flea_diag.core.residuals.relation_set import RelationSet
from flea_diag.core.residuals.residual_rows import ResidualSet
from flea_diag.core.symbolic.collect import divided, solved_for, terms_of
from flea_diag.core.symbolic.expression import (
    FUNCTIONS,
    ZERO,
    Expression,
    Variable,
    derivative,
    substitute,
    symbols,
    total,
)
from flea_diag.core.symbolic.generated import SCOPE, compiled, function_source
from flea_diag.errors import ModelError


@dataclass(frozen=True)
class DrivenChannels(Frozen):
    """Which channels drive a model and which it predicts, by the description; empty: none.

    Attributes
    ----------
    voltage, load
        Inputs. Without its own reading the voltage is given by ``command``.
    readings
        Of the motion, in the order of the model's measurements.
    position
        The one that is a state of the model.
    heated
        Readings of stores that the motion heats.
    around
        Readings that these exchange heat with, their own first.
    """

    voltage: str
    load: str
    command: str
    current: str
    position: str
    readings: tuple[str, ...]
    heated: tuple[str, ...]
    around: tuple[str, ...]

    @classmethod
    def of(cls, known: RelationSet, rows: ResidualSet) -> DrivenChannels:
        """Of one stand."""
        stores = [row for row in known.predictions if row.supply != ZERO or row.exchange]
        heated = tuple(row.channel for row in stores)
        around = tuple(dict.fromkeys((*heated, *(n for row in stores for n in row.exchange))))
        driven = rows.voltage, rows.load, rows.command, rows.current, rows.position
        return cls(*driven, rows.observed, heated, around)

    @property
    def inputs(self) -> tuple[str, str]:
        """Voltage and load."""
        return self.voltage, self.load

    @property
    def predicted(self) -> tuple[str, ...]:
        """All that is predicted, in the order of every innovation."""
        return self.readings + self.heated

    @property
    def speed(self) -> str:
        """Rate of the position."""
        return rate_symbol(self.position)

    @property
    def aloft(self) -> tuple[str, str, str]:
        """What readings depend on, beside parameters."""
        return self.voltage, self.speed, self.position

    @property
    def pushed(self) -> tuple[str, str, str]:
        """What the acceleration depends on, beside parameters and friction."""
        return self.current, self.speed, self.load


@dataclass(frozen=True, eq=False)
class DrivenEquations(Frozen):
    """What follows from one set of relations.

    Attributes
    ----------
    channels
        What drives the model, and what it predicts.
    readings
        Channel -> expression in ``aloft``; without those that no relation gives.
    acceleration
        Of the position, in ``pushed``; ``friction`` apart.
    friction
        The part of it with shapes, in speed and load.
    shapes
        Name -> function of the speed.
    command
        The voltage by the one commanded; ZERO where nothing relates them.
    supplies
        Heated channel -> its supply, in current, speed and shapes.
    winding
        Signal of the winding's temperature; empty: no relation has it.
    """

    channels: DrivenChannels
    readings: Mapping[str, Expression]
    acceleration: Expression
    friction: Expression
    shapes: Mapping[str, Expression]
    command: Expression
    supplies: Mapping[str, Expression]
    winding: str

    @cached_property
    def source(self) -> str:
        """Text of the generated functions of parameters and signals."""
        by = self.channels
        rows = [self._coefficients(self.readings.get(n, ZERO), by.aloft) for n in by.readings]
        current = {by.current: self.readings[by.current]}
        # With a last zero: numba knows no empty tuple of results.
        heats = [*(substitute(self.supplies[name], current) for name in by.heated), ZERO]
        warm = (self.winding,)
        return "\n".join(
            (
                function_source(
                    "readings", f"{', '.join(by.readings)} by {', '.join(by.aloft)}, 1.", warm, rows
                ),
                function_source(
                    "motion",
                    f"Acceleration by {', '.join(by.pushed)}, 1; voltage by {by.command}, 1.",
                    warm,
                    [
                        self._coefficients(self.acceleration, by.pushed),
                        self._coefficients(self.command, (by.command,)),
                    ],
                ),
                function_source(
                    "friction", "Acceleration.", by.pushed[1:], [self.friction], self.shapes
                ),
                function_source(
                    "supplies",
                    f"Unit per second of {', '.join(by.heated)}.",
                    (by.voltage, by.speed, *warm),
                    heats,
                    self.shapes,
                ),
            )
        )

    @staticmethod
    def _coefficients(row: Expression, names: tuple[str, ...]) -> list[Expression]:
        """Of these names, and what is left without them."""
        slopes = [derivative(row, name) for name in names]
        return [*slopes, substitute(row, dict.fromkeys(names, ZERO))]

    @cached_property
    def functions(self) -> Mapping[str, FunctionType]:
        """``readings``, ``motion``, ``friction`` and ``supplies``, compiled."""
        return compiled(self.source, {n: f for n, f in FUNCTIONS.items() if n not in SCOPE})


@lru_cache(maxsize=8)
def driven_equations(known: RelationSet, rows: ResidualSet) -> DrivenEquations:
    """Solve a set of relations for what each of them leaves open.

    Raises
    ------
    ModelError
        No relation gives current or acceleration, or one is not linear in what drives it.
    """
    by = DrivenChannels.of(known, rows)
    acceleration = rate_symbol(by.speed)
    shapes, found = known.shapes, dict(_solved(known, by))
    if by.current not in found or acceleration not in found:
        lost = by.current if by.current not in found else "acceleration"
        raise ModelError(
            f"the state observer needs {by.current or 'a motor current'} and the acceleration of "
            f"{by.position or 'a position'} by relations, and none gives the "
            f"{lost or 'current'}: draw what is missing, or set state_observer to none"
        )
    speeds = {name: e for name, e in found.items() if set(symbols(e)) & {by.speed, acceleration}}
    drawn = {name: substitute(shape, speeds) for name, shape in shapes.items()}
    rigid = {by.load: ZERO, **dict.fromkeys(shapes, ZERO)}
    rubbing: list[Expression] = []
    pushing: list[Expression] = []
    for term in terms_of(divided(found[acceleration])):
        (rubbing if set(symbols(term)) & set(shapes) else pushing).append(term)
    readings = {name: substitute(found[name], rigid) for name in by.readings if name in found}
    readings |= {name: Variable(name) for name in (by.voltage, by.position)}
    moving = {name: e for name, e in speeds.items() if name != by.current}
    supplies = {
        row.channel: substitute(row.supply, moving)
        for row in known.predictions
        if row.channel in by.heated
    }
    made = DrivenEquations(
        by,
        readings,
        total(pushing),
        total(rubbing),
        {n: drawn[n] for n, e in shapes.items() if not {by.load, by.current} & set(symbols(e))},
        found.get(by.command, ZERO),
        supplies,
        next((name for name in known.predicted if name in known.signals), ""),
    )
    _check(made)
    _check_inputs(made, known)
    return made


def _solved(known: RelationSet, by: DrivenChannels) -> Iterator[tuple[str, Expression]]:
    """Quantity -> by what relation it is given, in an order in which each has all that it needs."""
    given = {by.voltage, by.load, by.position, by.speed, *known.predicted, *known.shapes}
    # The observer takes a command as a mean voltage: what a bridge loses is part of its noise.
    sides = [name for name, shape in known.shapes.items() if by.current in symbols(shape)]
    solved: dict[str, Expression] = dict.fromkeys(sides, ZERO)
    left = list(known.relations)
    while left:
        for row in left:
            expression = substitute(row.expression, solved)
            inside = set(symbols(expression)) & {*known.signals, rate_symbol(by.speed)}
            unknown = inside - given
            if inside == {by.voltage, by.command}:
                unknown = {by.voltage}
            if len(unknown) == 1:
                break
        else:
            return
        left.remove(row)
        (name,) = unknown
        given_by = solved_for(name, expression)
        if given_by is None:
            continue
        solution = divided(given_by)
        if name == by.voltage:
            yield by.command, solution
            continue
        yield name, solution
        if name == by.current:
            given.add(name)  # the acceleration keeps it: with no load cell it is the push
            continue
        solved[name] = solution
        constants = frozenset(n for n in symbols(solution) if channel_of(n)[0] != by.position)
        solved[rate_symbol(name)] = time_derivative(solution, constants)


def _check(made: DrivenEquations) -> None:
    by = made.channels
    for what, row, names in (
        *((name, row, by.aloft) for name, row in made.readings.items()),
        ("acceleration", made.acceleration, by.pushed),
    ):
        for name in names:
            odd = set(symbols(derivative(row, name))) & {*by.aloft, *by.pushed}
            if odd:
                raise ModelError(
                    f"the state observer needs {what} linear in {', '.join(names)}, but its slope"
                    f" by {name} depends on {sorted(odd)[0]}: set state_observer to none"
                )


def _check_inputs(made: DrivenEquations, known: RelationSet) -> None:
    """Refuse what the model does not follow, such as a position that a weight depends on."""
    by = made.channels
    taken = {*by.pushed, by.voltage, made.winding, *known.shapes}
    for what, row, more in (
        ("acceleration", made.acceleration, ""),
        ("friction", made.friction, ""),
        *((name, shape, "") for name, shape in made.shapes.items()),
        *((name, row, by.position) for name, row in made.readings.items()),
    ):
        read = [n for n in symbols(row) if channel_of(n)[0] in known.units_of]
        odd = [n for n in read if n not in {*taken, more}]
        if odd:
            raise ModelError(
                f"the state observer does not follow {odd[0]}, which {what} depends on: set "
                "state_observer to none"
            )


def numbers(function: FunctionType, parameters: Any, degc: float) -> Any:
    """Coefficients as rows of floats."""
    return [np.array(row, dtype=float) for row in function(parameters, (degc,))]
