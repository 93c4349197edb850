"""The relations that run, compiled from the bond graph.

Each parity relation of the description is written in base parameters, as a sum of basis signals
(channels and their rates) with coefficients. From that one form come the functions that run on
scans, what healthy units differ by in them, and the equations that ``flea model`` prints.

A function such as tanh(v / v_s) is a shape: its width is assumed or fitted apart, and the bank of
residuals supplies its value. The smooth sign of the motion is one of them, because a screw that
stands under a push has a direction, too.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from types import FunctionType, MappingProxyType

from flea_diag.core.bond_graph.actuator_model import Actuator, ResidualSpec
from flea_diag.core.bond_graph.base_parameters import in_base
from flea_diag.core.frozen import Frozen
from flea_diag.core.residuals.parity import parity_relation
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
from flea_diag.errors import ModelError

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
        In the order of the description.
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
    push
        What friction has to withstand: the relation that has a direction, without its friction.
    base
        Base parameter -> product of physical parameters.
    offsets
        Channel -> what its reading exceeds the truth by, in base parameters.
    displacements
        Channels that read the integral of a flow.
    units_of
        Channel -> its unit.
    """

    relations: tuple[CompiledRelation, ...]
    signals: tuple[str, ...]
    shapes: Mapping[str, Function]
    predicted: Mapping[str, str]
    units: tuple[str, ...]
    push: Expression = ZERO
    reference: Mapping[str, float] = field(default_factory=dict)
    base: Mapping[str, Expression] = field(default_factory=dict)
    offsets: Mapping[str, Expression] = field(default_factory=dict)
    displacements: tuple[str, ...] = ()
    units_of: Mapping[str, str] = field(default_factory=dict)

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
        """Base parameters in the relations and shapes."""
        rows = [*(row.expression for row in self.relations), *self.shapes.values()]
        used = dict.fromkeys(name for row in rows for name in symbols(row))
        return tuple(name for name in used if name not in self.signals)

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
        dragged = next((r for r in self.relations if DIRECTION in r.signals), None)
        dry = -derivative(dragged.expression, DIRECTION) if dragged else ZERO
        arguments = [shape.argument for shape in self.shapes.values()]
        return "\n".join(
            function_source(name, doc, self.signals, results)
            for name, doc, results in (
                ("relations", f"Relations {', '.join(self.names)}.", rows),
                ("spreads", f"d r / d theta of {', '.join(self.differing)}.", spreads),
                ("drag", "Push, and the dry friction that it meets.", (self.push, dry)),
                ("shapes", f"Arguments of {', '.join(self.shapes)}.", arguments),
            )
        )

    @cached_property
    def functions(self) -> Mapping[str, FunctionType]:
        """``relations``, ``spreads``, ``drag`` and ``shapes``, compiled."""
        return compiled(self.source)


def relation_set(
    actuator: Actuator, names: Iterable[str], held: Collection[str], units: Sequence[str]
) -> RelationSet:
    """Compile those of the named residuals that the sensors of the actuator close.

    Parameters
    ----------
    held
        Base parameters that a calibration holds; of all others the description's value counts.
    units
        Base parameters in which healthy units differ.
    """
    rows, shapes = [], dict[Function, str]()
    push: Expression = ZERO
    base = _base_values(actuator, held)
    for name in names:
        spec = actuator.residuals.get(name)
        if spec is None or spec.normalised:
            continue  # the bank multiplies by the direction
        try:
            relation = parity_relation(actuator, spec)
        except ModelError:
            continue  # some sensor that it needs is not there
        varying = {*relation.arguments, *actuator.predicted}
        formed = divided(substitute(relation.expression, base))
        shaped = rewritten(formed, lambda node: _shape(node, shapes))
        varying |= set(shapes.values())
        read = tuple(symbol for symbol in symbols(shaped) if symbol in varying)
        rows.append(CompiledRelation(name, spec.unit, shaped, read, spec.kind))
        if DIRECTION in read and push == ZERO:
            bare = parity_relation(actuator, _without_friction(actuator, spec))
            push = divided(substitute(bare.expression, base))
    named = MappingProxyType({name: shape for shape, name in shapes.items()})
    inside = [name for shape in shapes for name in symbols(shape)]
    every = dict.fromkeys(name for row in rows for name in (*row.signals, *inside))
    measured = [name for name in every if name not in named and name not in held]
    return RelationSet(
        tuple(rows),
        (*measured, *named),
        named,
        dict(actuator.predicted),
        tuple(units),
        push,
        {name: actuator.graph.parameters[name].value for name in actuator.predicted},
        dict(actuator.base_parameters),
        {s.channel: base[s.offset] for s in actuator.sensors.values() if s.offset},
        tuple(s.channel for s in actuator.sensors.values() if s.integrates),
        actuator.units,
    )


def _without_friction(actuator: Actuator, spec: ResidualSpec) -> ResidualSpec:
    """The same balance without the elements that a direction of motion belongs to."""
    elements = actuator.graph.of_kind("R")
    rubbing = [element.name for element in elements if "smooth_flow" in element.parameters]
    return replace(spec, without=(*spec.without, *rubbing))


def _base_values(actuator: Actuator, held: Collection[str]) -> dict[str, Expression]:
    """Each physical parameter in base parameters, as numbers where no calibration holds them."""
    values = actuator.graph.values()
    fixed = {
        name: Constant(float(evaluate(definition, values)))
        for name, definition in actuator.base_parameters.items()
        if name not in held
    }
    known = {n: substitute(e, fixed) for n, e in in_base(actuator.base_parameters).items()}
    others = {n: Constant(v) for n, v in values.items() if n not in known and n not in held}
    return {n: e for n, e in {**others, **known}.items() if n not in actuator.predicted}


def _shape(node: Expression, shapes: dict[Function, str]) -> Expression:
    """A function that generated code cannot call, by its name among the shapes."""
    if not isinstance(node, Function) or node.name in SCOPE:
        return node
    if node not in shapes:
        first = node.name == "tanh" and DIRECTION not in shapes.values()
        shapes[node] = DIRECTION if first else f"shape_{len(shapes)}"
    return Variable(shapes[node])
