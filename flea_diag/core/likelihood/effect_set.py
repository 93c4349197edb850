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

"""Every effect of the catalogue on the relations of one stand, and the signals they are made of.

Compiled once for a description, a catalogue and a set of sensors, before any calibration. The
observer computes the basis signals of each scan by it, with the offsets of its unit; the isolator
binds the models to the parameters of a calibration.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping
from dataclasses import asdict, dataclass
from functools import cached_property
from types import FunctionType

from flea_diag.core.faults.fault import Fault
from flea_diag.core.frozen import Frozen
from flea_diag.core.likelihood.basis import Basis, UnitTerm
from flea_diag.core.likelihood.effects import ELAPSED, EffectRules, FaultEffect, faster
from flea_diag.core.likelihood.fault_models import FaultModel
from flea_diag.core.likelihood.plant_models import plant_models
from flea_diag.core.likelihood.sensor_models import expected, sensor_models
from flea_diag.core.likelihood.symbolic_model import SymbolicModel
from flea_diag.core.residuals.measured_graph import channel_of, rate_symbol
from flea_diag.core.residuals.parameters import LATER_TOLERANCES, ActuatorParameters
from flea_diag.core.residuals.relation_set import DIRECTION, RelationSet
from flea_diag.core.residuals.residual_rows import ResidualSet
from flea_diag.core.residuals.unit_difference import (
    WEIGHED_PARAMETERS,
    heating_rate,
    unit_differences,
)
from flea_diag.core.symbolic.expression import (
    ONE,
    Constant,
    Expression,
    Function,
    Variable,
    evaluate,
    substitute,
    symbols,
)
from flea_diag.core.symbolic.generated import compiled, function_source


def motion_signals(rows: ResidualSet) -> tuple[str, ...]:
    """Signals that the isolator follows beside those of the models; NaN on stands without them."""
    current, load, speed, position = rows.followed
    return current, load, DIRECTION, speed, rate_symbol(position)


@dataclass(frozen=True, eq=False)
class EffectSet(Frozen):
    """Models of all faults and differences of units in one set of relations.

    Attributes
    ----------
    basis
        Basis signals in corrected readings; the first is 1, the second the time since a detection.
    shapes
        Functions of signals that no relation holds, by name.
    told
        Reading -> the difference by which another one says what it should be.
    """

    relations: RelationSet
    models: tuple[SymbolicModel, ...]
    units: tuple[tuple[str, FaultEffect], ...]
    basis: tuple[Expression, ...]
    shapes: Mapping[str, Function]
    told: Mapping[str, str]

    @cached_property
    def names(self) -> tuple[str, ...]:
        """Names of the basis signals."""
        return tuple(map(name_of, self.basis))

    @cached_property
    def faults(self) -> frozenset[str]:
        """Faults that move a relation."""
        return frozenset(model.fault for model in self.models if model.effects)

    @cached_property
    def readings(self) -> tuple[str, ...]:
        """Basis signals that are the reading of a sensor which may be biased."""
        return tuple(name for name in self.names if f"{name}_bias" in self.faults)

    @property
    def residuals(self) -> ResidualSet:
        """The residuals of the stand."""
        return self.relations.residuals

    @property
    def temperatures(self) -> tuple[str, ...]:
        """Channels that are predicted, in the order of the residuals by prediction."""
        return tuple(self.residuals.predictions.values())

    @property
    def differences(self) -> tuple[str, ...]:
        """What healthy units differ by, in the order of their tolerances."""
        return unit_differences(self.residuals.predictions)

    @cached_property
    def signals(self) -> tuple[str, ...]:
        """What ``columns`` takes as ``x``.

        Signals of the relations, expected temperatures, shapes, and what this stand lacks.
        """
        temperatures = [expected(name).name for name in self.temperatures]
        return (*self.relations.signals, *temperatures, *self.shapes, *self.lacking)

    @cached_property
    def lacking(self) -> tuple[str, ...]:
        """Signals that the isolator follows and this stand does not read."""
        followed = motion_signals(self.residuals)
        return tuple(name for name in followed if name not in self.relations.signals)

    def needing(self, channel: str) -> frozenset[str]:
        """Relations that hold a reading, or on which a fault acts by it.

        Not predictions: what is predicted goes on without a neighbour that is not read.
        """
        read = {row.name: set(row.signals) for row in self.relations.relations}
        for model in self.models:
            for effect in model.effects:
                if effect.residual in read:
                    read[effect.residual].update(symbols(effect.basis))
        read |= {name: {channel} for name, channel in self.residuals.predictions.items()}
        return frozenset(
            name for name, signals in read.items() if any(channel in self._of(s) for s in signals)
        )

    def _of(self, signal: str) -> set[str]:
        """Channels that a signal is made of."""
        shape = self.relations.shapes.get(signal) or self.shapes.get(signal)
        if shape is not None:
            return set().union(*map(self._of, symbols(shape)))
        return {channel_of(signal)[0]}

    @cached_property
    def functions(self) -> Mapping[str, FunctionType]:
        """``columns(p, x)``, the basis signals of a scan, and ``shapes``, their arguments."""
        offsets = self.relations.offsets
        corrected = {channel: Variable(channel) - offset for channel, offset in offsets.items()}
        rows = [ZERO_AT_FIRST.get(b, b) for b in (substitute(e, corrected) for e in self.basis)]
        arguments = [shape.argument for shape in self.shapes.values()]
        return compiled(
            function_source("columns", "Basis signals.", self.signals, rows)
            + function_source("shapes", "Arguments of the shapes.", self.signals, arguments)
        )

    def bound(
        self, parameters: ActuatorParameters, is_vibration_only: bool = False
    ) -> tuple[FaultModel, ...]:
        """Models with the parameters of one calibration.

        ``is_vibration_only``: for a screw that vibrates while no relation deviates; those faults
        alone that say what they add at least.
        """
        values = asdict(parameters)
        if not is_vibration_only:
            return tuple(m.bound(values, name_of) for m in self.models if not m.vibration_only)
        least = {model.fault for model in self.models if model.has_least}
        return tuple(m.bound(values, name_of, True) for m in self.models if m.fault in least)

    def basis_of(self, parameters: ActuatorParameters) -> Basis:
        """The basis with the unit terms of one calibration."""
        values = asdict(parameters)
        found = [
            UnitTerm(e.residual, difference, name_of(e.basis), float(evaluate(e.gain, values)))
            for difference, e in self.units
        ]
        return Basis(self.names, tuple(found), self.differences)


ZERO_AT_FIRST: dict[Expression, Expression] = {ELAPSED: Constant(0.0)}
"""What is known only once there is an onset."""


def name_of(basis: Expression) -> str:
    """Name of a basis signal, as in the records."""
    return "one" if basis == ONE else str(basis)


def effect_set(relations: RelationSet, faults: Iterable[Fault]) -> EffectSet:
    """Compile the effects of these faults on these relations."""
    rules = EffectRules(relations)
    models = [
        model
        for fault in faults
        for model in (
            sensor_models(fault, rules, relations) if fault.channel else plant_models(fault, rules)
        )
    ]
    units = (
        *_of_parameters(rules, relations.tolerances),
        *_of_temperatures(relations.residuals.predictions),
    )
    used = [effect.basis for model in models for effect in model.effects]
    used += [effect.basis for _, effect in units]
    followed = map(Variable, motion_signals(relations.residuals))
    basis = dict.fromkeys((ONE, ELAPSED, *followed, *used))
    differences = {channel: rules.told(channel) for channel in relations.residuals.channels}
    told = {channel: row.name for channel, row in differences.items() if row}
    return EffectSet(relations, tuple(models), units, tuple(basis), dict(rules.shapes), told)


def _of_parameters(
    rules: EffectRules, stated: Collection[str]
) -> tuple[tuple[str, FaultEffect], ...]:
    """What a parameter of the unit that is smaller by one leaves in the relations."""
    less = Constant(-1.0)
    weighed = (*WEIGHED_PARAMETERS, *(n for n in LATER_TOLERANCES if n in stated))
    return tuple((name, effect) for name in weighed for effect in rules.moved({name: less}))


def _of_temperatures(predicted: Iterable[str]) -> Iterable[tuple[str, FaultEffect]]:
    """A part that heats up faster than its node by 1 K/s."""
    for name in predicted:
        for effect in faster(name, ONE):
            yield heating_rate(name), effect
