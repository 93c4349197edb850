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

"""From a description to the relations that its sensors close, in base parameters."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from types import MappingProxyType

from flea_diag.core.bond_graph.actuator_model import Actuator, ResidualSpec
from flea_diag.core.bond_graph.base_parameters import in_base, rewritten_in
from flea_diag.core.residuals.measured_graph import MECHANICAL, channel_of
from flea_diag.core.residuals.parity import ParityRelation, parity_relation
from flea_diag.core.residuals.prediction import Prediction, prediction
from flea_diag.core.residuals.relation_set import DIRECTION, CompiledRelation, RelationSet
from flea_diag.core.residuals.stop import stop_of
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
from flea_diag.core.symbolic.generated import SCOPE
from flea_diag.errors import ModelError, shown


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
        moves = partial(_of_motion, actuator) if spec.kind != "difference" else _never
        shape_of = partial(_shape, shapes=shapes, moves=moves)
        shaped = rewritten(base.form(relation.expression), shape_of)
        varying = {*relation.arguments, *actuator.predicted, *shapes.values()}
        read = tuple(symbol for symbol in symbols(shaped) if symbol in varying)
        rows.append(CompiledRelation(spec.name, spec.unit, shaped, read, spec.kind, spec.pair))
        if DIRECTION in read and push == ZERO and spec.kind == "junction":
            bare = parity_relation(actuator, _without_friction(actuator, spec))
            push = rewritten(base.form(bare.expression), shape_of)
            dry = -derivative(shaped, DIRECTION)
    rows.sort(key=lambda row: _rank(actuator, row))
    predictions = _predictions(actuator, base, shapes)
    named = MappingProxyType({name: shape for shape, name in shapes.items()})
    inside = [symbols(each) for each in (*shapes, *(row.supply for row in predictions))]
    every = dict.fromkeys(n for read in (*(row.signals for row in rows), *inside) for n in read)
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
        described=_described(actuator, held),
        tolerances=actuator.tolerances,
        base_units=actuator.base_units,
        free=actuator.free_per_run,
        held=dict(actuator.operating.hold),
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


def _described(actuator: Actuator, held: Collection[str]) -> Mapping[str, float]:
    """Values of base parameters that a calibration holds: what no recording fixes keeps it."""
    values, base = actuator.graph.values(), actuator.base_parameters
    return {name: float(evaluate(base[name], values)) for name in base if name in held}


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
        shape_of = partial(_shape, shapes=shapes, moves=partial(_of_motion, actuator))
        supply = rewritten(base.form(row.supply), shape_of)
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


def _never(shape: Function) -> bool:
    return False


def _of_motion(actuator: Actuator, shape: Function) -> bool:
    """Whether a function is the smooth sign of a motion: its argument reads nothing else."""
    read = [channel_of(name) for name in symbols(shape.argument)]
    sensors = [(actuator.sensors[name], order) for name, order in read if name in actuator.sensors]
    places = [(actuator.graph.elements.get(sensor.at), order) for sensor, order in sensors]
    return (
        shape.name == "tanh"
        and bool(places)
        and all(place is not None and place.domain in MECHANICAL for place, _ in places)
    )


def _shape(
    node: Expression, shapes: dict[Function, str], moves: Callable[[Function], bool]
) -> Expression:
    """A function that generated code cannot call, by its name among the shapes.

    The first smooth sign of a motion in a balance is the direction.
    """
    if not isinstance(node, Function) or node.name in SCOPE:
        return node
    if node not in shapes:
        first = DIRECTION not in shapes.values() and moves(node)
        shapes[node] = DIRECTION if first else f"shape_{len(shapes)}"
    return Variable(shapes[node])
