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

"""Effects of faults on the relations that run, by differentiation.

An error e of a reading y enters a relation as ``dr/dy * e``, and through the rate of the reading as
``dr/dy' * de/dt``. A change of a parameter enters as ``-dr/dtheta`` times the change: the relation
is formed with the healthy value, and what the parameter has gained is left of its own term.
A reading that is dead lacks its true value; where another relation gives that value, it is
eliminated by it (one relation for all, so that a single truth is missing everywhere).

Every effect is a sum of gains, which hold parameters, times basis signals, which hold corrected
readings (a reading less its offset), rates and shapes. Slow states are held at the description's
value: they change an effect by percents.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

from flea_diag.core.residuals.channel_units import CURRENT
from flea_diag.core.residuals.measured_graph import channel_of, rate_symbol
from flea_diag.core.residuals.parameters import LEAD
from flea_diag.core.residuals.relation_set import DIRECTION, CompiledRelation, RelationSet
from flea_diag.core.residuals.thermal import CORRECTION_S
from flea_diag.core.symbolic.collect import collect, power_of, solved_for
from flea_diag.core.symbolic.expression import (
    ONE,
    ZERO,
    Constant,
    Expression,
    Function,
    Variable,
    derivative,
    substitute,
    symbols,
    total,
)


@dataclass(frozen=True, slots=True)
class FaultEffect:
    """``size[index] * gain * basis`` in one residual."""

    residual: str
    basis: Expression
    gain: Expression
    index: int = 0


Effects = tuple[FaultEffect, ...]
POWER = "power"
ELAPSED = Variable("elapsed_s")
"""Time since the detection, s."""
Gains = tuple[tuple[str, Expression], ...]
"""Residual and gain of a constant."""


class EffectRules:
    """Effects in one set of relations, in its base parameters.

    Attributes
    ----------
    shapes
        Name -> function, of those that the relations do not hold: a shape of a signal that another
        relation gives.
    """

    def __init__(self, relations: RelationSet) -> None:
        self._set = relations
        self._slow = {name: Constant(value) for name, value in relations.reference.items()}
        self._held = {name: Constant(value) for name, value in relations.held.items()}
        self._true = {
            channel: Variable(channel) + offset for channel, offset in relations.offsets.items()
        }
        self.shapes: dict[str, Function] = {}
        self._answer = _answer(relations)

    def gains(self, channel: str) -> Gains:
        """By how much a constant error of a reading moves each relation that reads it.

        What varies with motion in it, such as the share of the friction that grows with the load,
        is left out.
        """
        return self._constant(channel)

    def rates(self, channel: str) -> Gains:
        """The same of an error that grows by one a second, through the rate of the reading."""
        return self._constant(rate_symbol(channel))

    def products(self, channel: str) -> Effects:
        """Of a constant error of a reading that multiplies another signal in a difference.

        Such is a supply that scales what a bridge makes of its command.
        """
        return tuple(
            effect
            for row in self._set.relations
            if row.kind == "difference" and channel in row.signals and channel not in row.pair
            for effect in self._effects(row, derivative(row.expression, channel), 0)
            if effect.basis != ONE
        )

    def of_power(self, channel: str, rate: Expression, index: int = 0) -> Effects:
        """Of an error of the rate of a reading in the balances of power, which multiply by it."""
        symbol = rate_symbol(channel)
        return tuple(
            effect
            for row in self._set.relations
            if row.kind == POWER
            for effect in self._effects(row, derivative(row.expression, symbol) * rate, index)
        )

    def _constant(self, symbol: str) -> Gains:
        found = []
        for row in self._set.relations:
            if row.kind == POWER and channel_of(symbol)[1]:
                continue  # by its rate: see of_power
            parts = self._collected(row, derivative(row.expression, symbol))
            if ONE in parts:
                found.append((row.name, parts[ONE]))
        return tuple(found)

    def moved(self, amounts: Mapping[str, Expression], index: int = 0) -> Effects:
        """Of base parameters that are larger by these amounts for each unit of the size.

        What acts by a current that answers to one balance alone acts by what that says of it.
        """
        found: list[FaultEffect] = []
        for row in self._set.relations:
            grown = _moved(row.expression, amounts)
            if self._answer is not None:
                grown = substitute(grown, {CURRENT: self._answer[1]})
            found += self._effects(row, grown, index)
        return tuple(found)

    def predicted(self, amounts: Mapping[str, Expression], index: int = 0) -> Effects:
        """The same in predictions: a rate, that of the held operating point once it is warm."""
        found: list[FaultEffect] = []
        for row in self._set.predictions:
            grown = total(a * derivative(row.rate, name) for name, a in amounts.items())
            rate = substitute(substitute(substitute(grown, row.warm), self._true), self._held)
            if rate != ZERO and not set(symbols(rate)) & set(self._signals):
                found += faster(row.name, rate, index)
        return tuple(found)

    def grown(self, amounts: Mapping[str, Expression], index: int = 0) -> Effects:
        """In the balances; what no balance shows is left to the predictions, which heat lags."""
        return self.moved(amounts, index) or self.predicted(amounts, index)

    def scaled(self, shares: Mapping[str, float], index: int = 0) -> Effects:
        """Of physical parameters that are larger by these shares of themselves."""
        amounts: dict[str, Expression] = {}
        for name, definition in self._set.base.items():
            share = sum(power_of(physical, definition) * s for physical, s in shares.items())
            if share:
                amounts[name] = Constant(share) * Variable(name)
        return self.grown(amounts, index)

    def opened(self, physical: Iterable[str], index: int = 0) -> Effects:
        """Of elements that nothing flows through: relations without what they took."""
        base = self._set.base
        gone = {
            name: ZERO
            for opened in physical
            for name, definition in base.items()
            if power_of(opened, definition) > 0
        }
        return tuple(
            effect
            for row in self._set.relations
            if set(gone) & set(symbols(row.expression))
            for effect in self._effects(row, substitute(row.expression, gone), index)
        )

    def added(self, residual: str, drag: Expression, index: int = 0) -> Effects:
        """Of a drag that is no change of a parameter, in corrected readings.

        None without the relation, or without a reading that the drag is made of. In a prediction
        it is a rate, at which what is read runs away from what is predicted.
        """
        row = self._set.named.get(residual)
        if row is None:
            predicted = any(each.name == residual for each in self._set.predictions)
            return faster(residual, drag, index) if predicted else ()
        drag, signals = self._in_what_is_read(drag), self._signals
        known = self._set.residuals.channels
        if any(channel_of(s)[0] in known and s not in signals for s in symbols(drag)):
            return ()
        parts = collect(drag, signals)
        return tuple(FaultEffect(residual, basis, gain, index) for basis, gain in parts.items())

    def _in_what_is_read(self, drag: Expression) -> Expression:
        """A drag by the speed of the motor, where only the rate of the position is read."""
        rows = self._set.residuals
        if rows.encoder in self._set.signals:
            return drag
        rate = Variable(rate_symbol(rows.position))
        return substitute(drag, {rows.encoder: rate / Variable(LEAD)})

    def lost(self, channel: str, index: int = 0) -> Effects:
        """Of the true value that is missing where this channel reads zero.

        A difference lacks its second reading. A balance lacks what the difference with another
        reading says the value is, and without one all that its other terms say. Balances that read
        the rate alone are left out: nothing else tells that rate. A channel that nothing but the
        balance with the friction reads would explain any drag by its own death; there the truth
        leaves out what varies with the motion.
        """
        found: list[FaultEffect] = []
        for row in self._set.relations:
            read = [s for s in row.signals if channel_of(s)[0] == channel]
            if channel in row.pair:
                found += self._effects(row, self._without(row.expression, read), index)
            elif channel in read:
                bare = self._without(row.expression, [channel])
                truth = self._truth(channel)
                if truth is not None:
                    bare = bare - self._given(row, channel, truth)
                elif DIRECTION in row.signals and self._readers(channel) == 1:
                    bare = substitute(bare, dict.fromkeys(self._moving(row), ZERO))
                found += self._effects(row, bare, index)
        return tuple(found)

    def response(self, channel: str) -> tuple[tuple[Expression, Expression], ...]:
        """What the other terms of the only balance with this reading say that it should be.

        As basis signals with their factors; none for any but a current that the balance with the
        friction alone reads. Such a current answers to motion and load, and what the balance leaves
        is its own scatter: a share of the reading would explain that scatter as well, and win over
        any drag that is as large.
        """
        if channel != CURRENT or self._answer is None:
            return ()
        return tuple(self._collected(*self._answer).items())

    def _readers(self, channel: str) -> int:
        return sum(channel in row.signals for row in self._set.relations)

    def _moving(self, row: CompiledRelation) -> set[str]:
        """Signals of a relation that vary with the motion: shapes, what they are of, rates."""
        shapes = self._set.shapes
        flows = {n for s in row.signals if s in shapes for n in symbols(shapes[s])}
        return {s for s in row.signals if s in shapes or s in flows or channel_of(s)[1]}

    def told(self, channel: str) -> CompiledRelation | None:
        """The difference by which another reading says what this one should be, if there is one."""
        for row in self._set.relations:
            if channel in row.pair and channel in row.signals:
                share = derivative(row.expression, channel)
                if not set(symbols(share)) & set(self._set.signals):
                    return row
        return None

    def _truth(self, channel: str) -> Expression | None:
        """What another reading says that this one should be; None if none does."""
        row = self.told(channel)
        return solved_for(channel, row.expression) if row else None

    def _without(self, expression: Expression, read: Iterable[str]) -> Expression:
        """The expression where these signals read their zero."""
        gone: dict[str, Expression] = {s: self._set.offsets.get(s, ZERO) for s in read}
        for name, shape in self._set.shapes.items():
            if set(gone) & set(symbols(shape)):
                gone[name] = ZERO
        return substitute(expression, gone)

    def _given(self, row: CompiledRelation, channel: str, truth: Expression) -> Expression:
        """The relation with a channel eliminated by what another reading says of it."""
        given: dict[str, Expression] = {channel: truth}
        for name, shape in self._set.shapes.items():
            if channel in symbols(shape):
                made = substitute(shape, given)
                assert isinstance(made, Function)
                told = "_".join(s for s in symbols(made) if s in self._set.signals)
                self.shapes[f"{name}_by_{told}"] = made
                given[name] = Variable(f"{name}_by_{told}")
        return substitute(row.expression, given)

    @property
    def _signals(self) -> tuple[str, ...]:
        return (*self._set.signals, *self.shapes)

    def _collected(
        self, row: CompiledRelation, expression: Expression
    ) -> Mapping[Expression, Expression]:
        corrected = substitute(substitute(expression, self._slow), self._true)
        return {b: g for b, g in collect(corrected, self._signals).items() if g != ZERO}

    def _effects(
        self, row: CompiledRelation, expression: Expression, index: int
    ) -> tuple[FaultEffect, ...]:
        parts = self._collected(row, expression)
        return tuple(FaultEffect(row.name, basis, gain, index) for basis, gain in parts.items())


def faster(prediction: str, rate: Expression, index: int = 0) -> Effects:
    """Of a store that rises faster than predicted, by its unit per second.

    The estimate that is frozen at the detection has lagged behind by its time of correction.
    """
    lag = FaultEffect(prediction, ONE, rate * Constant(CORRECTION_S), index)
    return (lag, FaultEffect(prediction, ELAPSED, rate, index))


def _answer(relations: RelationSet) -> tuple[CompiledRelation, Expression] | None:
    """The balance whose current answers to motion and load alone, and what it says of that."""
    read = [row for row in relations.relations if CURRENT in row.signals]
    if len(read) != 1 or DIRECTION not in read[0].signals:
        return None
    answer = solved_for(CURRENT, read[0].expression)
    return None if answer is None else (read[0], answer)


def _moved(expression: Expression, amounts: Mapping[str, Expression]) -> Expression:
    """What is left of a relation whose parameters have grown by these amounts."""
    return total(-1 * amount * derivative(expression, name) for name, amount in amounts.items())
