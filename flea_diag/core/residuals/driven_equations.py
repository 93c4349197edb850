"""State equations of the driven model, from the relations of the bond graph.

Every relation leaves one quantity open that the others do not: the balance of the motor circuit the
current, the balance of forces the acceleration, two readings of one motion each other. Solved for
it, the relations are what sensors read and how fast the motion changes (Narasimhan et al. 2010,
section 4.1), in base parameters. For the FLEA at its nut:

    i   = i0 + (V - V0 - Ke v) / R(T)
    M v' = K (i - i0) - (fc + c|F|) s(v) - B v - F           s(v) = tanh(v / v_s)
    x'  = v

Terms with a shape, such as the smooth sign, are friction; all else is linear, and its coefficients
are numbers as long as parameters and winding temperature are.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property, lru_cache
from types import FunctionType
from typing import Any

import numpy as np

from flea_diag.core.frozen import Frozen
from flea_diag.core.residuals.parity import channel_of, rate_symbol, time_derivative
from flea_diag.core.residuals.relation_set import RelationSet
from flea_diag.core.symbolic.collect import divided, solved_for, terms_of
from flea_diag.core.symbolic.expression import (
    ZERO,
    Expression,
    Variable,
    derivative,
    substitute,
    symbols,
    total,
)
from flea_diag.core.symbolic.generated import compiled, function_source
from flea_diag.errors import ModelError

VOLTAGE, LOAD, COMMAND = "motor_voltage", "load_force", "commanded_voltage"
CURRENT, POSITION = "motor_current", "actuator_position"
SPEED = rate_symbol(POSITION)
ACCELERATION = rate_symbol(SPEED)

CHANNELS = (CURRENT, VOLTAGE, "motor_speed", POSITION, "load_position")
"""Readings of the motion, in the order of the model's measurements."""
HEATED = ("motor_temperature", "nut_temperature")
"""Readings of stores that the motion heats."""
ALOFT = (VOLTAGE, SPEED, POSITION)
"""What readings depend on, beside parameters."""
PUSHED = (CURRENT, SPEED, LOAD)
"""What the acceleration depends on, beside parameters and friction."""


@dataclass(frozen=True, eq=False)
class DrivenEquations(Frozen):
    """What follows from one set of relations.

    Attributes
    ----------
    readings
        Channel -> expression in ``ALOFT``; without those that no relation gives.
    acceleration
        Of the position, in ``PUSHED``; ``friction`` apart.
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
        rows = [self._coefficients(self.readings.get(name, ZERO), ALOFT) for name in CHANNELS]
        current = {CURRENT: self.readings[CURRENT]}
        heats = [substitute(self.supplies.get(name, ZERO), current) for name in HEATED]
        warm = (self.winding,)
        return "\n".join(
            (
                function_source(
                    "readings", f"{', '.join(CHANNELS)} by {', '.join(ALOFT)}, 1.", warm, rows
                ),
                function_source(
                    "motion",
                    f"Acceleration by {', '.join(PUSHED)}, 1; voltage by {COMMAND}, 1.",
                    warm,
                    [
                        self._coefficients(self.acceleration, PUSHED),
                        self._coefficients(self.command, (COMMAND,)),
                    ],
                ),
                function_source(
                    "friction", "Acceleration.", (SPEED, LOAD), [self.friction], self.shapes
                ),
                function_source(
                    "supplies",
                    f"Unit per second of {', '.join(HEATED)}.",
                    (VOLTAGE, SPEED, *warm),
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
        return compiled(self.source, {"tanh": np.tanh, "exp": np.exp})


@lru_cache(maxsize=8)
def driven_equations(known: RelationSet) -> DrivenEquations:
    """Solve a set of relations for what each of them leaves open.

    Raises
    ------
    ModelError
        No relation gives current or acceleration, or one is not linear in what drives it.
    """
    shapes, found = known.shapes, dict(_solved(known))
    if CURRENT not in found or ACCELERATION not in found:
        lost = CURRENT if CURRENT not in found else "acceleration"
        raise ModelError(
            f"the state observer needs {CURRENT} and the acceleration of {POSITION} by relations, "
            f"and none gives the {lost}: draw what is missing, or set state_observer to none"
        )
    speeds = {name: e for name, e in found.items() if set(symbols(e)) & {SPEED, ACCELERATION}}
    drawn = {name: substitute(shape, speeds) for name, shape in shapes.items()}
    rubbing: list[Expression] = []
    pushing: list[Expression] = []
    for term in terms_of(divided(found[ACCELERATION])):
        (rubbing if set(symbols(term)) & set(shapes) else pushing).append(term)
    readings = {name: found[name] for name in CHANNELS if name in found}
    readings |= {name: Variable(name) for name in (VOLTAGE, POSITION)}
    supplies = {
        row.channel: substitute(row.supply, {n: e for n, e in speeds.items() if n != CURRENT})
        for row in known.predictions
        if row.channel in HEATED
    }
    made = DrivenEquations(
        readings,
        total(pushing),
        total(rubbing),
        drawn,
        found.get(COMMAND, ZERO),
        supplies,
        next((name for name in known.predicted if name in known.signals), ""),
    )
    _check(made)
    return made


def _solved(known: RelationSet) -> Iterator[tuple[str, Expression]]:
    """Quantity -> by what relation it is given, in an order in which each has all that it needs."""
    given = {VOLTAGE, LOAD, POSITION, SPEED, *known.predicted, *known.shapes}
    solved: dict[str, Expression] = {}
    left = list(known.relations)
    while left:
        for row in left:
            expression = substitute(row.expression, solved)
            inside = set(symbols(expression)) & {*known.signals, ACCELERATION}
            unknown = inside - given
            if inside == {VOLTAGE, COMMAND}:
                unknown = {VOLTAGE}
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
        if name == VOLTAGE:
            yield COMMAND, solution
            continue
        yield name, solution
        if name == CURRENT:
            given.add(CURRENT)  # the acceleration keeps it: with no load cell it is the push
            continue
        solved[name] = solution
        constants = frozenset(n for n in symbols(solution) if channel_of(n)[0] != POSITION)
        solved[rate_symbol(name)] = time_derivative(solution, constants)


def _check(made: DrivenEquations) -> None:
    for what, row, names in (
        *((name, row, ALOFT) for name, row in made.readings.items()),
        ("acceleration", made.acceleration, PUSHED),
    ):
        for name in names:
            odd = set(symbols(derivative(row, name))) & {*ALOFT, *PUSHED}
            if odd:
                raise ModelError(
                    f"the state observer needs {what} linear in {', '.join(names)}, but its slope"
                    f" by {name} depends on {sorted(odd)[0]}: set state_observer to none"
                )


def numbers(function: FunctionType, parameters: Any, degc: float) -> Any:
    """Coefficients as rows of floats."""
    return [np.array(row, dtype=float) for row in function(parameters, (degc,))]
