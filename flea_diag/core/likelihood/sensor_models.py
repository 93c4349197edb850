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

"""Models of sensor faults: one rule per mode, the same for every channel.

The modes differ only in what the error e of the reading y is (y' is the true signal):

bias e = b    drift e = d t    scaling e = (1 - 1/g) y    dead e = c - y'

(scaling of a temperature, or of a current that one balance alone reads: e = (g - 1) times what its
relation expects)
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass

from flea_diag.core.faults.effect_row import SizeBounds
from flea_diag.core.faults.fault import Fault
from flea_diag.core.likelihood.effects import ELAPSED, EffectRules, Effects, FaultEffect, Gains
from flea_diag.core.likelihood.symbolic_model import SymbolicModel
from flea_diag.core.residuals.measured_graph import rate_symbol
from flea_diag.core.residuals.relation_set import RelationSet
from flea_diag.core.residuals.thermal import CORRECTION_S
from flea_diag.core.symbolic.expression import (
    ONE,
    ZERO,
    Constant,
    Expression,
    Variable,
    symbols,
    total,
)

Signal = tuple[tuple[Expression, Expression], ...]
"""A sum of basis signals, each with its factor."""

CONSTANT, GROWING = ((ONE, ONE),), ((ELAPSED, ONE),)


def expected(temperature: str) -> Variable:
    """What a temperature should read by its prediction, degC."""
    return Variable(f"{temperature}_degc")


@dataclass(frozen=True)
class ReadingError:
    """How an error of one reading enters the residuals.

    ``gains`` and ``rates``: of the error and of its rate. ``lost``: the truth that is missing where
    the reading is dead. ``shares``: what a scaling adds of ``reading``, its least and largest.
    """

    fault: Fault
    unit: str
    gains: Gains
    rates: Gains
    lost: Effects
    largest_drift: float
    reading: Signal
    reading_rate: Signal
    shares: tuple[float, float]
    rules: EffectRules | None = None
    """Those of the balances that multiply by the rate of the reading; None: none does."""
    products: Effects = ()
    """Of a constant error where the reading multiplies another signal."""

    def level(self, signal: Signal, index: int = 0) -> Effects:
        """The error is a constant, or follows a signal."""
        multiplied = tuple(
            FaultEffect(each.residual, each.basis * basis, each.gain * factor, index)
            for each in self.products
            for basis, factor in signal
            if basis != ELAPSED and factor != ZERO
        )
        return _times(self.gains, signal, index) + multiplied

    def rate(self, signal: Signal) -> Effects:
        """The same of the rate of the error."""
        rate = total(basis * factor for basis, factor in signal)
        powers = self.rules.of_power(self.fault.channel, rate) if self.rules else ()
        return _times(self.rates, signal) + powers


def sensor_models(
    fault: Fault, rules: EffectRules, relations: RelationSet
) -> Iterable[SymbolicModel]:
    """Models of one sensor fault.

    None for a channel that no relation may read (an encoder of unknown lead), and for modes that
    the tests of single sensors judge.
    """
    rule = _MODES.get(fault.mode)
    known = fault.channel in (*relations.residuals.predictions.values(), *relations.units_of)
    return () if rule is None or not known else rule(_error(fault, rules, relations))


def _error(fault: Fault, rules: EffectRules, relations: RelationSet) -> ReadingError:
    channel, low, high = fault.channel, *fault.errors.factors
    if channel in relations.residuals.predictions.values():
        reading: Signal = ((expected(channel), ONE),)
        shares = low - 1.0, high - 1.0
        gains, drift = _of_prediction(channel, relations), fault.errors.drift
        return ReadingError(fault, "K", gains, (), (), drift, reading, (), shares)
    response = rules.response(channel)
    reading = response or ((Variable(channel), ONE), (ONE, relations.offsets.get(channel, ZERO)))
    shares = (low - 1.0, high - 1.0) if response else (1.0 - 1.0 / low, 1.0 - 1.0 / high)
    # The rate of a speed acts through the inertia, by less than the noise: no effect.
    rates = rules.rates(channel) if channel in relations.displacements else ()
    return ReadingError(
        fault,
        relations.units_of[channel],
        rules.gains(channel),
        rates,
        rules.lost(channel),
        _largest_drift(fault, relations),
        reading,
        ((Variable(rate_symbol(channel)), ONE),),
        shares,
        rules if channel in relations.displacements else None,
        rules.products(channel),
    )


def _largest_drift(fault: Fault, relations: RelationSet) -> float:
    """In its unit per second; where its slope is the only speed there is another bound."""
    shapes = relations.shapes.values()
    as_speed = any(rate_symbol(fault.channel) in symbols(shape) for shape in shapes)
    return fault.errors.drift_as_speed if as_speed else fault.errors.drift


def _of_prediction(channel: str, relations: RelationSet) -> Gains:
    """Its own residual; a store that exchanges with it lags behind by the time of correction."""
    own = tuple((row.name, ONE) for row in relations.predictions if row.channel == channel)
    lag = Constant(-CORRECTION_S)
    beside = (row for row in relations.predictions if channel in row.exchange)
    return (*own, *((row.name, lag * row.exchange[channel]) for row in beside))


def _times(gains: Gains, signal: Signal, index: int = 0) -> Effects:
    """Each gain times each part of the signal."""
    return tuple(
        FaultEffect(residual, basis, gain * factor, index)
        for residual, gain in gains
        for basis, factor in signal
        if factor != ZERO
    )


def _bias(error: ReadingError) -> tuple[SymbolicModel, ...]:
    return (_one(error, _size("bias", error), error.level(CONSTANT)),)


def _scaling(error: ReadingError) -> tuple[SymbolicModel, ...]:
    low, high = error.shares
    size = SizeBounds("scaling share", "1", low, high, low)
    return (_one(error, size, error.level(error.reading) + error.rate(error.reading_rate)),)


def _drift(error: ReadingError) -> tuple[SymbolicModel, ...]:
    """One model per age: the offset at detection is the rate times the age.

    With a free offset beside the rate, every bias would fit as a drift that has just stopped.
    """
    largest = error.largest_drift
    size = SizeBounds("drift", f"{error.unit}/s", -largest, largest, -largest)
    grown, rate = error.level(GROWING), error.rate(CONSTANT)
    return tuple(
        _one(error, size, grown + _aged(error, age_s) + rate) for age_s in error.fault.errors.ages_s
    )


def _aged(error: ReadingError, age_s: float) -> Effects:
    grown = tuple(FaultEffect(name, ONE, gain * age_s) for name, gain in error.gains)
    # What it grows by after its detection is left out where it multiplies a signal.
    return grown + tuple(FaultEffect(e.residual, e.basis, e.gain * age_s) for e in error.products)


def _dead(error: ReadingError) -> tuple[SymbolicModel, ...]:
    level = _size("level", error)
    if not error.lost:
        # No other signal gives the true value: a constant, like a bias.
        return (_one(error, level, error.level(CONSTANT)),)
    low, high = error.fault.errors.lost
    sizes = (SizeBounds("lost share", "1", low, high, low), level)
    effects = error.lost + error.level(CONSTANT, 1)
    return (SymbolicModel(error.fault.name, sizes, effects, channel=error.fault.channel),)


def _size(name: str, error: ReadingError) -> SizeBounds:
    largest = error.fault.errors.bias
    return SizeBounds(name, error.unit, -largest, largest, -largest)


def _one(error: ReadingError, size: SizeBounds, effects: Effects) -> SymbolicModel:
    return SymbolicModel(error.fault.name, (size,), effects, channel=error.fault.channel)


_MODES: dict[str, Callable[[ReadingError], Iterable[SymbolicModel]]] = {
    "bias": _bias,
    "scaling": _scaling,
    "drift": _drift,
    "dead": _dead,
}
