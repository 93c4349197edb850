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

"""The relations that run, compiled from the bond graph.

Each parity relation of the description is written in base parameters, as a sum of basis signals
(channels and their rates) with coefficients. From that one form come the functions that run on
scans, what healthy units differ by in them, and the equations that ``flea model`` prints.

A function such as tanh(v / v_s) is a shape: its width is assumed or fitted apart, and the bank of
residuals supplies its value. The smooth sign of the motion is one of them, because a screw that
stands under a push has a direction, too.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from functools import cached_property
from types import FunctionType
from typing import Any

import numpy as np
import numpy.typing as npt

from flea_diag.core.bond_graph.tolerance import Tolerance
from flea_diag.core.frozen import Frozen
from flea_diag.core.residuals.measured_graph import channel_of
from flea_diag.core.residuals.parameters import LATER_TOLERANCES, ZEROS
from flea_diag.core.residuals.prediction import Prediction
from flea_diag.core.residuals.residual_rows import ReadingTerm, ResidualSet
from flea_diag.core.residuals.stop import Stop
from flea_diag.core.symbolic.collect import expand
from flea_diag.core.symbolic.expression import (
    ZERO,
    Expression,
    Function,
    Variable,
    derivative,
    evaluate,
    symbols,
    total,
)
from flea_diag.core.symbolic.generated import compiled, function_source

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
    pair: tuple[str, ...] = ()
    """The two readings of a difference."""


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
    base_units
        Base parameter -> its unit, which those of the physical ones give.
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
        Base parameter that a calibration holds -> the description's value.
    residuals
        Of the description, whatever sensors are fitted.
    tolerances
        Name -> by how much healthy units differ, where the description says so.
    free
        Base parameter that each run may have its own value of -> its range.
    held
        Channel -> its magnitude at the operating point.
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
    base_units: Mapping[str, str] = field(default_factory=dict)
    free: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    held: Mapping[str, float] = field(default_factory=dict)

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

    @property
    def rubbed(self) -> tuple[str, ...]:
        """Predictions of what friction heats."""
        return tuple(row.name for row in self.predictions if DIRECTION in symbols(row.supply))

    @cached_property
    def differing(self) -> tuple[str, ...]:
        """Relations in which healthy units differ."""
        return tuple(
            row.name
            for row in self.relations
            if any(self._apart(row, unit) != ZERO for unit in self.units)
        )

    def reading_terms(self, parameters: Any) -> tuple[ReadingTerm, ...]:
        """Readings that enter, as they are, a residual in which healthy units differ.

        A supply swings: what a command is answered with is no constant of a unit.
        """
        known, rows = asdict(parameters), self.residuals
        zeros = {name: evaluate(offset, known) for name, offset in self.offsets.items()}
        return tuple(
            ReadingTerm(
                row.name,
                name,
                self.signals.index(name),
                float(zeros.get(name, 0.0)),
                self._depends(row.relation),
                self._warmed(row.relation),
                self._beside(row.relation),
            )
            for row in rows.parities
            if row.differs and not row.normalised and row.relation in self.named
            if rows.command not in self.named[row.relation].signals
            for name in self.named[row.relation].signals
            if name in rows.units
        )

    def reading_signs(self, parameters: Any, relation: str) -> npt.NDArray[np.float64] | None:
        """Sign of d r / d reading of each channel, shape (channels,).

        0 where a reading does not enter, or by a shape alone. None where a rate enters, or where a
        sign depends on other readings.
        """
        row, channels = self.named[relation], self.residuals.channels
        known = {**self.reference, **asdict(parameters)}
        gains = [derivative(row.expression, name) for name in channels]
        if any(channel_of(name)[1] for name in row.signals):
            return None
        if any(not set(symbols(gain)) <= set(known) for gain in gains):
            return None
        return np.sign([float(evaluate(gain, known)) for gain in gains])

    def _depends(self, relation: str) -> tuple[int, ...]:
        """Places of the unit parameters that a relation depends on."""
        row = self.named[relation]
        return tuple(k for k, unit in enumerate(self.units) if self._apart(row, unit) != ZERO)

    def _warmed(self, relation: str) -> tuple[tuple[int, int], ...]:
        """Parameters of ``_depends`` that follow a predicted store, and which."""
        row, stores = self.named[relation], [store.name for store in self.predictions]
        return tuple(
            (place, stores.index(self.predicted[signal]) + lag * len(stores))
            for place, unit in enumerate(self._depends(relation))
            for signal in symbols(self._apart(row, self.units[unit]))
            if self.predicted.get(signal) in stores
            for lag in range(2)
        )

    def _beside(self, relation: str) -> tuple[tuple[int, int], ...]:
        """Sizes of ``_depends`` in a relation of a predicted store that do not follow it."""
        row, follow = self.named[relation], {place for place, _ in self._warmed(relation)}
        return tuple(
            (place, self.signals.index(signal))
            for place, unit in enumerate(self._depends(relation))
            if place not in follow and self.units[unit] not in ZEROS
            for signal in row.signals
            if signal in self.predicted
        )

    def _apart(self, row: CompiledRelation, unit: str) -> Expression:
        """D r / d theta; 0 for what healthy units are alike in unless the description says more."""
        if not self._states(unit) or unit == self.unscaled.get(row.name):
            return ZERO
        return derivative(row.expression, unit)

    def _states(self, unit: str) -> bool:
        return unit not in LATER_TOLERANCES or unit in self.tolerances

    @cached_property
    def unscaled(self) -> Mapping[str, str]:
        """Relation whose every term units differ in -> the parameter that the others stand for.

        Where nothing of known size enters, such as a load cell's reading, a unit in which all terms
        are larger by one share is the same: one of them is then no difference between units.
        """
        found = {}
        for row in self.relations:
            sizes = [u for u in self.units if u not in ZEROS and self._states(u)]
            sizes = [u for u in sizes if u in symbols(row.expression)]
            terms = (Variable(u) * derivative(row.expression, u) for u in sizes)
            if sizes and expand(total(terms) - row.expression) == ZERO:
                found[row.name] = sizes[-1]
        return found

    @cached_property
    def source(self) -> str:
        """Text of the functions, all of parameters ``p`` and signals ``x``."""
        rows = [row.expression for row in self.relations]
        apart = [row for row in self.relations if row.name in self.differing]
        spreads = [[self._apart(row, unit) for unit in self.units] for row in apart]
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
