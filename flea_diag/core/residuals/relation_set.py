"""The relations that run, compiled from the bond graph.

Each parity relation of the description is written in base parameters, as a sum of basis signals
(channels and their rates) with coefficients. From that one form come the functions that run on
scans, what healthy units differ by in them, and the equations that ``flea model`` prints.

A function such as tanh(v / v_s) is a shape: its width is assumed or fitted apart, and the bank of
residuals supplies its value. The smooth sign of the motion is one of them, because a screw that
stands under a push has a direction, too.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from types import FunctionType, MappingProxyType
from typing import Any

import numpy as np
import numpy.typing as npt

from flea_diag.core.bond_graph.actuator_model import Actuator, ResidualSpec
from flea_diag.core.bond_graph.base_parameters import in_base, rewritten_in
from flea_diag.core.bond_graph.tolerance import Tolerance
from flea_diag.core.frozen import Frozen
from flea_diag.core.residuals.parity import ParityRelation, parity_relation
from flea_diag.core.residuals.prediction import Prediction, prediction
from flea_diag.core.residuals.residual_rows import ResidualSet
from flea_diag.core.residuals.stop import Stop, stop_of
from flea_diag.core.symbolic.collect import divided
from flea_diag.core.symbolic.expression import (
    ZERO,
    Constant,
    Expression,
    Function,
    Variable,
    derivative,
    evaluate,
    rewritten,
    substitute,
    symbols,
)
from flea_diag.core.symbolic.generated import SCOPE, compiled, function_source
from flea_diag.errors import ModelError, shown

DIRECTION = "direction"
"""Signal: the smooth sign of the motion, or of the push where the actuator is stalled."""


@dataclass(frozen=True)
class CompiledRelation:
    """r = expression, in ``unit``, zero without a fault; in signals and base parameters."""

    name: str
    unit: str
    expression: Expression
    signals: tuple[str, ...]
    """Names that vary from scan to scan."""
    kind: str = "junction"
    """As in the description: ``junction`` is a balance, ``difference`` two readings of one."""


@dataclass(frozen=True, eq=False)
class RelationSet(Frozen):
    """Every relation that the sensors of one stand close, and the code that computes them.

    Attributes
    ----------
    relations
        Balances with friction first, then other balances, differences from a command, others; each
        in the order of the description.
    signals
        What the functions take as ``x``, in this order; shapes come last.
    shapes
        Name -> function and argument, in signals and base parameters.
    predicted
        Signal that a slow state sets -> the residual whose prediction gives it.
    reference
        The same signals with the description's value.
    units
        Base parameters in which healthy units differ.
    push, dry
        What friction has to withstand: the balance that has a direction, without its friction; and
        the dry friction that it meets.
    base
        Base parameter -> product of physical parameters.
    offsets
        Channel -> what its reading exceeds the truth by, in base parameters.
    displacements
        Channels that read the integral of a flow.
    units_of
        Channel -> its unit.
    predictions
        Relations by prediction, in the order of the description.
    every
        The same for every sensor of the description, fitted or not; None if these are.
    stop
        Ends of travel, and the relations that the reaction of a stop enters.
    described
        Base parameter in the relations -> the description's value.
    residuals
        Of the description, whatever sensors are fitted.
    tolerances
        Name -> by how much healthy units differ, where the description says so.
    """

    relations: tuple[CompiledRelation, ...]
    signals: tuple[str, ...]
    shapes: Mapping[str, Function]
    predicted: Mapping[str, str]
    units: tuple[str, ...]
    push: Expression = ZERO
    dry: Expression = ZERO
    reference: Mapping[str, float] = field(default_factory=dict)
    base: Mapping[str, Expression] = field(default_factory=dict)
    offsets: Mapping[str, Expression] = field(default_factory=dict)
    displacements: tuple[str, ...] = ()
    units_of: Mapping[str, str] = field(default_factory=dict)
    predictions: tuple[Prediction, ...] = ()
    every: RelationSet | None = None
    stop: Stop = field(default_factory=Stop)
    described: Mapping[str, float] = field(default_factory=dict)
    residuals: ResidualSet = field(default_factory=lambda: ResidualSet({}, ()))
    tolerances: Mapping[str, Tolerance] = field(default_factory=dict)

    @cached_property
    def names(self) -> tuple[str, ...]:
        """Names of the relations."""
        return tuple(row.name for row in self.relations)

    @cached_property
    def named(self) -> Mapping[str, CompiledRelation]:
        """Relations by name."""
        return {row.name: row for row in self.relations}

    @cached_property
    def parameters(self) -> tuple[str, ...]:
        """Base parameters in the relations, shapes and predictions."""
        rows = [*(row.expression for row in self.relations), *self.shapes.values()]
        rows += [row.rate for row in self.predictions]
        used = dict.fromkeys(name for row in rows for name in symbols(row))
        known = {*self.signals, *(row.channel for row in self.predictions)}
        return tuple(n for n in used if n not in known and n not in self.neighbours)

    @cached_property
    def neighbours(self) -> tuple[str, ...]:
        """Channels that predicted stores exchange with."""
        return tuple(dict.fromkeys(name for row in self.predictions for name in row.exchange))

    @cached_property
    def differing(self) -> tuple[str, ...]:
        """Relations in which healthy units differ."""
        return tuple(
            row.name
            for row in self.relations
            if any(derivative(row.expression, unit) != ZERO for unit in self.units)
        )

    @cached_property
    def source(self) -> str:
        """Text of the functions, all of parameters ``p`` and signals ``x``."""
        rows = [row.expression for row in self.relations]
        apart = [row.expression for row in self.relations if row.name in self.differing]
        spreads = [[derivative(row, unit) for unit in self.units] for row in apart]
        arguments = [shape.argument for shape in self.shapes.values()]
        # Each with a last zero: numba knows no empty tuple of results.
        supplies = [*(row.supply for row in self.predictions), ZERO]
        exchanges = [
            [*(row.exchange.get(name, ZERO) for name in self.neighbours), ZERO]
            for row in self.predictions
        ]
        predicted = ", ".join(row.name for row in self.predictions)
        return "\n".join(
            function_source(name, doc, self.signals, results)
            for name, doc, results in (
                ("relations", f"Relations {', '.join(self.names)}.", rows),
                ("spreads", f"d r / d theta of {', '.join(self.differing)}.", spreads),
                ("drag", "Push, and the dry friction that it meets.", (self.push, self.dry)),
                ("shapes", f"Arguments of {', '.join(self.shapes)}.", arguments),
                ("supplies", f"Unit per second of {predicted}.", supplies),
                ("exchanges", f"1/s with {', '.join(self.neighbours)} of {predicted}.", exchanges),
            )
        )

    @cached_property
    def functions(self) -> Mapping[str, FunctionType]:
        """By name as in ``source``, compiled."""
        return compiled(self.source)

    def exchange_rates(self, parameters: Any) -> npt.NDArray[np.float64]:
        """1/s, shape (predictions, neighbours): d rate / d neighbour of every predicted store."""
        rates = np.array(self.functions["exchanges"](parameters, ()), dtype=float)
        return rates.reshape(len(self.predictions), len(self.neighbours) + 1)[:, :-1]

    def exchange_rate(self, parameters: Any, residual: str, channel: str) -> float:
        """1/s: d rate / d channel of one predicted store, 0 if they do not exchange."""
        names = [row.name for row in self.predictions]
        if residual not in names or channel not in self.neighbours:
            return 0.0
        rates = self.exchange_rates(parameters)
        return float(rates[names.index(residual), self.neighbours.index(channel)])


def relation_set(
    actuator: Actuator,
    names: Iterable[str],
    held: Collection[str],
    units: Sequence[str],
    unread: Collection[str] = (),
) -> RelationSet:
    """Compile those of the named residuals that the sensors of the actuator close.

    Parameters
    ----------
    held
        Base parameters that a calibration holds; of all others the description's value counts.
    units
        Base parameters in which healthy units differ.
    unread
        Inputs that no channel reads.
    """
    rows, shapes = [], dict[Function, str]()
    push: Expression = ZERO
    dry: Expression = ZERO
    base = _Base.of(actuator, held)
    for spec, relation in _closed(actuator, names, unread):
        shaped = rewritten(base.form(relation.expression), lambda node: _shape(node, shapes))
        varying = {*relation.arguments, *actuator.predicted, *shapes.values()}
        read = tuple(symbol for symbol in symbols(shaped) if symbol in varying)
        rows.append(CompiledRelation(spec.name, spec.unit, shaped, read, spec.kind))
        if DIRECTION in read and push == ZERO and spec.kind == "junction":
            bare = parity_relation(actuator, _without_friction(actuator, spec))
            push, dry = base.form(bare.expression), -derivative(shaped, DIRECTION)
    rows.sort(key=lambda row: _rank(actuator, row))
    predictions = _predictions(actuator, base, shapes)
    named = MappingProxyType({name: shape for shape, name in shapes.items()})
    inside = [name for shape in shapes for name in symbols(shape)]
    supplied = [name for row in predictions for name in symbols(row.supply)]
    every = dict.fromkeys([*(n for row in rows for n in row.signals), *inside, *supplied])
    measured = [name for name in every if name not in named and name not in held]
    return RelationSet(
        tuple(rows),
        (*measured, *named),
        named,
        dict(actuator.predicted),
        tuple(units),
        push,
        dry,
        {name: actuator.graph.parameters[name].value for name in actuator.predicted},
        dict(actuator.base_parameters),
        {s.channel: base.form(Variable(s.offset)) for s in actuator.sensors.values() if s.offset},
        tuple(s.channel for s in actuator.sensors.values() if s.integrates),
        actuator.units,
        predictions,
        stop=stop_of(actuator, [row.name for row in rows]),
        described=_described(actuator, held, rows, shapes),
        tolerances=actuator.tolerances,
    )


def _closed(
    actuator: Actuator, names: Iterable[str], unread: Collection[str]
) -> Iterator[tuple[ResidualSpec, ParityRelation]]:
    """Those of the named residuals that sensors and recorded inputs close, not normalised.

    The bank multiplies by the direction.
    """
    for name in names:
        if name in actuator.residuals:
            spec = replace(actuator.residuals[name], normalised=False)
            try:
                relation = parity_relation(actuator, spec)
            except ModelError:
                continue  # some sensor that it needs is not there
            if not set(relation.channels) & set(unread):
                yield spec, relation


def _described(
    actuator: Actuator,
    held: Collection[str],
    rows: Iterable[CompiledRelation],
    shapes: Iterable[Function],
) -> Mapping[str, float]:
    """Values of those base parameters that a calibration holds and a relation or shape reads.

    And of the inductance: no recording shows it, so a calibration holds that of the data sheet.
    """
    forms = (*(row.expression for row in rows), *shapes)
    read = {name for form in forms for name in symbols(form)} & set(held)
    read.add("winding_inductance_h")
    values, base = actuator.graph.values(), actuator.base_parameters
    return {name: float(evaluate(base[name], values)) for name in base if name in read}


def _rank(actuator: Actuator, row: CompiledRelation) -> int:
    """Place of a relation among those of other kinds."""
    if row.kind != "difference":
        return 0 if DIRECTION in row.signals else 1
    return 3 if actuator.residuals[row.name].reference in actuator.sensors else 2


def _predictions(
    actuator: Actuator, base: _Base, shapes: dict[Function, str]
) -> tuple[Prediction, ...]:
    """Those that the sensors close, in the order of the description."""
    found = []
    for spec in actuator.residuals.values():
        if spec.kind != "prediction":
            continue
        try:
            row = prediction(actuator, spec)
        except ModelError:
            continue
        supply = rewritten(base.form(row.supply), lambda node: _shape(node, shapes))
        exchange = {name: base.form(rate) for name, rate in row.exchange.items()}
        circle = [name for name in actuator.predicted if name in symbols(supply)]
        if circle:
            raise ModelError(
                f"{actuator.name}: residual {shown(spec.name)}: {circle[0]} is predicted itself; "
                "name the parameter that brings it in under neglected"
            )
        found.append(replace(row, supply=supply, exchange=exchange))
    return tuple(found)


def _without_friction(actuator: Actuator, spec: ResidualSpec) -> ResidualSpec:
    """The same balance without the elements that a direction of motion belongs to."""
    elements = actuator.graph.of_kind("R")
    rubbing = [element.name for element in elements if "smooth_flow" in element.parameters]
    return replace(spec, without=(*spec.without, *rubbing))


@dataclass(frozen=True)
class _Base:
    """Writes expressions in base parameters, and as numbers what no calibration holds."""

    known: Mapping[Expression, Expression]
    fixed: Mapping[str, Expression]

    @classmethod
    def of(cls, actuator: Actuator, held: Collection[str]) -> _Base:
        values = actuator.graph.values()
        solved = in_base(actuator.base_parameters)
        values |= {n: float(evaluate(e, values)) for n, e in actuator.base_parameters.items()}
        numbers = {n: Constant(v) for n, v in values.items() if n not in held}
        return cls(
            {old: new for old, new in solved.items() if str(old) not in actuator.predicted},
            {n: number for n, number in numbers.items() if n not in actuator.predicted},
        )

    def form(self, expression: Expression) -> Expression:
        # What the products cancel must be gone before numbers stand for what is left.
        return divided(substitute(divided(rewritten_in(expression, self.known)), self.fixed))


def _shape(node: Expression, shapes: dict[Function, str]) -> Expression:
    """A function that generated code cannot call, by its name among the shapes."""
    if not isinstance(node, Function) or node.name in SCOPE:
        return node
    if node not in shapes:
        first = node.name == "tanh" and DIRECTION not in shapes.values()
        shapes[node] = DIRECTION if first else f"shape_{len(shapes)}"
    return Variable(shapes[node])
