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

"""Small algebra for constituent laws: build, differentiate, print and compile expressions.

Just what the equations of a bond graph need: sums, products, integer powers and a few
smooth functions. Constructors keep a normal form (constants folded, like terms collected),
so that equal expressions compare equal and derived equations print as one would write them.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import Any, Union

import numpy as np

Operand = Union["Expression", float, int]

FUNCTIONS: dict[str, Callable[[Any], Any]] = {
    "tanh": np.tanh,
    "exp": np.exp,
    "fabs": np.fabs,
    "sign": np.sign,
    "sin": np.sin,
    "cos": np.cos,
}
"""Every function an expression may hold; compiled code sees these names and no others."""


@dataclass(frozen=True)
class Expression:
    """Base of all terms; immutable, hashable, built with the usual operators."""

    def __add__(self, other: Operand) -> Expression:
        return total((self, lift(other)))

    def __radd__(self, other: Operand) -> Expression:
        return total((lift(other), self))

    def __sub__(self, other: Operand) -> Expression:
        return total((self, -lift(other)))

    def __rsub__(self, other: Operand) -> Expression:
        return total((lift(other), -self))

    def __mul__(self, other: Operand) -> Expression:
        return product((self, lift(other)))

    def __rmul__(self, other: Operand) -> Expression:
        return product((lift(other), self))

    def __truediv__(self, other: Operand) -> Expression:
        return product((self, power(lift(other), -1)))

    def __rtruediv__(self, other: Operand) -> Expression:
        return product((lift(other), power(self, -1)))

    def __pow__(self, exponent: int) -> Expression:
        return power(self, exponent)

    def __neg__(self) -> Expression:
        return product((Constant(-1.0), self))

    def __str__(self) -> str:
        return text(self)

    def __reduce__(self) -> tuple[Any, ...]:
        """Without its hash: another process has others."""
        return type(self), tuple(getattr(self, name) for name in self.__dataclass_fields__)

    @cached_property
    def _hash(self) -> int:
        return hash((type(self), *(getattr(self, name) for name in self.__dataclass_fields__)))

    def _hash_once(self) -> int:
        """Of what holds others: else each look-up of a sum would hash all that is in it again."""
        return self._hash


@dataclass(frozen=True)
class Constant(Expression):
    """A number."""

    value: float


@dataclass(frozen=True)
class Variable(Expression):
    """A variable or parameter; its name is a Python identifier."""

    name: str


@dataclass(frozen=True)
class Sum(Expression):
    """At least two terms."""

    terms: tuple[Expression, ...]
    __hash__ = Expression._hash_once


@dataclass(frozen=True)
class Product(Expression):
    """At least two factors, the numeric one first."""

    factors: tuple[Expression, ...]
    __hash__ = Expression._hash_once


@dataclass(frozen=True)
class Power(Expression):
    """Integer power other than 0 and 1."""

    base: Expression
    exponent: int
    __hash__ = Expression._hash_once


@dataclass(frozen=True)
class Function(Expression):
    """One of ``FUNCTIONS`` applied to an argument."""

    name: str
    argument: Expression
    __hash__ = Expression._hash_once


ZERO, ONE = Constant(0.0), Constant(1.0)


def lift(value: Operand) -> Expression:
    """Expression of a number, or the expression itself."""
    return value if isinstance(value, Expression) else Constant(float(value))


def total(terms: Iterable[Expression]) -> Expression:
    """Sum in normal form: flat, constants folded, like terms collected."""
    coefficients: dict[Expression, float] = {}
    for term in terms:
        for part in term.terms if isinstance(term, Sum) else (term,):
            factor, rest = _coefficient(part)
            coefficients[rest] = coefficients.get(rest, 0.0) + factor
    kept = [
        rest if c == 1.0 else product((Constant(c), rest))
        for rest, c in coefficients.items()
        if c != 0.0
    ]
    if not kept:
        return ZERO
    return kept[0] if len(kept) == 1 else Sum(tuple(kept))


def product(factors: Iterable[Expression]) -> Expression:
    """Product in normal form: flat, numbers first, powers of equal bases merged."""
    number, exponents = 1.0, dict[Expression, int]()
    for factor in factors:
        for part in factor.factors if isinstance(factor, Product) else (factor,):
            if isinstance(part, Constant):
                number *= part.value
                continue
            base, exponent = (part.base, part.exponent) if isinstance(part, Power) else (part, 1)
            exponents[base] = exponents.get(base, 0) + exponent
    if number == 0.0:
        return ZERO
    kept = [power(base, exponent) for base, exponent in exponents.items() if exponent]
    if len(kept) == 1 and isinstance(kept[0], Sum):
        return total(product((Constant(number), term)) for term in kept[0].terms)
    if number != 1.0 or not kept:
        kept.insert(0, Constant(number))
    return kept[0] if len(kept) == 1 else Product(tuple(kept))


def power(base: Expression, exponent: int) -> Expression:
    """Integer power in normal form."""
    if exponent == 0:
        return ONE
    if exponent == 1:
        return base
    if isinstance(base, Constant):
        return Constant(base.value**exponent)
    if isinstance(base, Power):
        return power(base.base, base.exponent * exponent)
    if isinstance(base, Product):
        return product(power(factor, exponent) for factor in base.factors)
    return Power(base, exponent)


def apply(name: str, argument: Operand) -> Expression:
    """Function of an argument, folded when the argument is a number."""
    inner = lift(argument)
    if isinstance(inner, Constant):
        return Constant(float(FUNCTIONS[name](inner.value)))
    return Function(name, inner)


def _coefficient(term: Expression) -> tuple[float, Expression]:
    if isinstance(term, Constant):
        return term.value, ONE
    if isinstance(term, Product) and isinstance(term.factors[0], Constant):
        rest = term.factors[1:]
        return term.factors[0].value, rest[0] if len(rest) == 1 else Product(rest)
    return 1.0, term


def _children(expression: Expression) -> tuple[Expression, ...]:
    if isinstance(expression, Sum):
        return expression.terms
    if isinstance(expression, Product):
        return expression.factors
    if isinstance(expression, Power):
        return (expression.base,)
    return (expression.argument,) if isinstance(expression, Function) else ()


def symbols(expression: Expression) -> tuple[str, ...]:
    """Names in an expression, in order of appearance, each once."""
    if isinstance(expression, Variable):
        return (expression.name,)
    found = dict.fromkeys(n for child in _children(expression) for n in symbols(child))
    return tuple(found)


def rewritten(expression: Expression, change: Callable[[Expression], Expression]) -> Expression:
    """The expression with ``change`` applied to every node, leaves first, back in normal form."""
    return change(_rebuilt(expression, lambda child: rewritten(child, change)))


def substitute(expression: Expression, values: Mapping[str, Expression]) -> Expression:
    """The expression with symbols replaced at once, back in normal form.

    What takes the place of a symbol is not replaced again, where it cancels to that symbol either.
    """
    if isinstance(expression, Variable):
        return values.get(expression.name, expression)
    return _rebuilt(expression, lambda child: substitute(child, values))


def _rebuilt(expression: Expression, made: Callable[[Expression], Expression]) -> Expression:
    """The expression of other children."""
    if isinstance(expression, Sum):
        return total(map(made, expression.terms))
    if isinstance(expression, Product):
        return product(map(made, expression.factors))
    if isinstance(expression, Power):
        return power(made(expression.base), expression.exponent)
    if isinstance(expression, Function):
        return apply(expression.name, made(expression.argument))
    return expression


@lru_cache(maxsize=16384)
def derivative(expression: Expression, name: str) -> Expression:
    """Exact partial derivative with respect to one symbol."""
    if isinstance(expression, Variable):
        return ONE if expression.name == name else ZERO
    if isinstance(expression, Sum):
        return total(derivative(term, name) for term in expression.terms)
    if isinstance(expression, Product):
        factors = expression.factors
        return total(
            product((*factors[:k], derivative(factor, name), *factors[k + 1 :]))
            for k, factor in enumerate(factors)
        )
    if isinstance(expression, Power):
        inner = derivative(expression.base, name)
        return expression.exponent * power(expression.base, expression.exponent - 1) * inner
    if isinstance(expression, Function):
        return _OUTER[expression.name](expression) * derivative(expression.argument, name)
    return ZERO


_OUTER: dict[str, Callable[[Function], Expression]] = {
    "tanh": lambda f: 1 - f**2,
    "exp": lambda f: f,
    "fabs": lambda f: apply("sign", f.argument),
    "sign": lambda f: ZERO,
    "sin": lambda f: apply("cos", f.argument),
    "cos": lambda f: -apply("sin", f.argument),
}


def evaluate(expression: Expression, values: Mapping[str, Any]) -> Any:
    """Number (or array) of an expression; KeyError names a symbol that has no value."""
    if isinstance(expression, Constant):
        return expression.value
    if isinstance(expression, Variable):
        return values[expression.name]
    if isinstance(expression, Power):
        return evaluate(expression.base, values) ** float(expression.exponent)
    if isinstance(expression, Function):
        return FUNCTIONS[expression.name](evaluate(expression.argument, values))
    parts = [evaluate(child, values) for child in _children(expression)]
    return sum(parts) if isinstance(expression, Sum) else math.prod(parts)


def text(expression: Expression) -> str:
    """Infix text; it is valid Python and compiles to the same value."""
    if isinstance(expression, Constant):
        return f"{expression.value:.12g}"
    if isinstance(expression, Variable):
        return expression.name
    if isinstance(expression, Function):
        return f"{expression.name}({text(expression.argument)})"
    if isinstance(expression, Sum):
        return _sum_text(expression)
    return _product_text(expression)


def _sum_text(expression: Sum) -> str:
    signed = sorted((_coefficient(term)[0] < 0, k) for k, term in enumerate(expression.terms))
    words = ""
    for negative, k in signed:
        term = expression.terms[k]
        piece = text(-term if negative else term)
        words += f" {'-' if negative else '+'} {piece}" if words else ("-" * negative + piece)
    return words


def _product_text(expression: Expression) -> str:
    number, rest = _coefficient(expression)
    factors = rest.factors if isinstance(rest, Product) else (rest,)
    above = [f for f in factors if not (isinstance(f, Power) and f.exponent < 0)]
    below = [power(f, -1) for f in factors if isinstance(f, Power) and f.exponent < 0]
    upper = "*".join(_factor_text(f) for f in above if f != ONE)
    if abs(number) != 1.0 or not upper:
        upper = f"{abs(number):.12g}" + (f"*{upper}" if upper else "")
    lower = "*".join(_factor_text(f) for f in below)
    if lower:
        upper += f"/({lower})" if len(below) > 1 else f"/{lower}"
    return ("-" if number < 0 else "") + upper


def _factor_text(factor: Expression) -> str:
    if isinstance(factor, Power):
        return f"{_factor_text(factor.base)}**{factor.exponent}"
    return f"({text(factor)})" if isinstance(factor, (Sum, Product)) else text(factor)
