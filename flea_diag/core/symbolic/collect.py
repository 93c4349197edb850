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

"""Expand expressions and collect them by signals: r = sum of coefficient * basis signal.

A parity relation is linear in what recordings can identify of its parameters. ``expand`` writes it
as a sum of monomials, ``collect`` splits each of them into a coefficient, which holds parameters
alone, and a basis signal, which holds signals. A function whose argument holds both, such as the
smooth sign tanh(v / v_s), is part of the signal: a shape of its own.
"""

from __future__ import annotations

import itertools
import math
import re
from collections.abc import Collection, Mapping
from functools import lru_cache
from types import MappingProxyType

from flea_diag.core.symbolic.expression import (
    ONE,
    ZERO,
    Expression,
    Function,
    Power,
    Product,
    Sum,
    Variable,
    apply,
    derivative,
    power,
    product,
    rewritten,
    substitute,
    symbols,
    total,
)
from flea_diag.errors import ConfigurationError, shown

MOST_TERMS = 10_000
"""A relation with more monomials is a mistake in the description, and would fill the memory."""

_NAME = r"[A-Za-z_]\w*"
_FACTOR = re.compile(
    rf"([*/]?)(?:({_NAME})(?!\w|\()|\(({_NAME}(?:\+{_NAME})+)\)|fabs\(({_NAME})\))(?:\^(\d))?"
)


def expand(expression: Expression) -> Expression:
    """The same value as a sum of monomials: no product and no positive power holds a sum.

    Arguments of functions and bases of negative powers are expanded each for itself.

    Raises
    ------
    ConfigurationError
        More than ``MOST_TERMS`` monomials.
    """
    if isinstance(expression, Sum):
        return total(map(expand, expression.terms))
    if isinstance(expression, Product):
        return _multiplied([expand(factor) for factor in expression.factors])
    if isinstance(expression, Power):
        base = expand(expression.base)
        if isinstance(base, Sum) and expression.exponent > 1:
            return _multiplied([base] * expression.exponent)
        return power(base, expression.exponent)
    if isinstance(expression, Function):
        return apply(expression.name, expand(expression.argument))
    return expression


def _multiplied(factors: list[Expression]) -> Expression:
    """Product of expanded factors, term by term."""
    terms = [terms_of(factor) for factor in factors]
    count = math.prod(map(len, terms))
    if count > MOST_TERMS:
        raise ConfigurationError(f"a relation expands to {count} terms, the limit is {MOST_TERMS}")
    return total(product(choice) for choice in itertools.product(*terms))


def terms_of(expression: Expression) -> tuple[Expression, ...]:
    """Terms of a sum; anything else is one term."""
    return expression.terms if isinstance(expression, Sum) else (expression,)


def factors_of(term: Expression) -> tuple[Expression, ...]:
    """Factors of a product; anything else is one factor."""
    return term.factors if isinstance(term, Product) else (term,)


def divided(expression: Expression) -> Expression:
    """The same with every division of a sum by a name carried out term by term.

    What cancels in the terms is gone; sums that nothing divides stay as they are.
    """
    return rewritten(expression, _divided_product)


def _divided_product(node: Expression) -> Expression:
    factors = factors_of(node)
    below = [f for f in factors if isinstance(f, Power) and f.exponent < 0]
    below = [f for f in below if isinstance(f.base, Variable)]
    whole = next((f for f in factors if isinstance(f, Sum)), None)
    if whole is None or not below:
        return node
    quotient = total(_divided_product(product((term, *below))) for term in whole.terms)
    return product((quotient, *(f for f in factors if f is not whole and f not in below)))


def collect(expression: Expression, signals: Collection[str]) -> Mapping[Expression, Expression]:
    """Basis signal -> coefficient, in order of appearance; their products sum to the expression.

    Parameters
    ----------
    signals
        Names that vary from scan to scan; all others are parameters. The basis signal of a term
        without any of them is 1.
    """
    return _collected(expression, frozenset(signals))


@lru_cache(maxsize=4096)
def _collected(expression: Expression, signals: frozenset[str]) -> Mapping[Expression, Expression]:
    found: dict[Expression, Expression] = {}
    for term in terms_of(expand(expression)):
        factors = factors_of(term)
        varying = [f for f in factors if not signals.isdisjoint(symbols(f))]
        basis = product(varying)
        constant = product(f for f in factors if f not in varying)
        found[basis] = found[basis] + constant if basis in found else constant
    return MappingProxyType(found)


def monomial(text: str) -> Expression:
    """Expression of a product such as ``screw_viscous_friction/screw_ratio^2``.

    Each ``/`` divides by one factor. A factor may be a sum of names in parentheses, or ``fabs`` of
    a name. The product of nothing is ``1``.

    Raises
    ------
    ConfigurationError
        Anything else than names, ``*``, ``/``, ``^`` with one digit and such sums.
    """
    found: Expression = ONE
    if text == "1":
        return found
    place = 0
    while place < len(text) or not text:
        token = _FACTOR.match(text, place)
        if token is None or (place > 0) != bool(token[1]):
            raise ConfigurationError(
                f"{shown(text)} is not a product of parameters; write it as a*b/c^2"
            )
        exponent = int(token[5] or 1) * (-1 if token[1] == "/" else 1)
        factor = total(Variable(name) for name in (token[2] or token[3] or token[4]).split("+"))
        found = found * power(apply("fabs", factor) if token[4] else factor, exponent)
        place = token.end()
    return found


def solved_for(name: str, expression: Expression) -> Expression | None:
    """What a name is where the expression is zero; None where it is not linear in it."""
    slope = derivative(expression, name)
    if slope == ZERO or name in symbols(slope):
        return None
    return -substitute(expression, {name: ZERO}) / slope


def power_of(name: str, expression: Expression) -> int:
    """Exponent of a name as a factor of a product; 0 where it is none, also inside a sum."""
    own = (_base_and_exponent(factor) for factor in factors_of(expression))
    return sum(exponent for base, exponent in own if base == Variable(name))


def _base_and_exponent(factor: Expression) -> tuple[Expression, int]:
    return (factor.base, factor.exponent) if isinstance(factor, Power) else (factor, 1)


def exponents(expression: Expression) -> Mapping[str, int]:
    """Exponent of each name in a product of powers of names.

    Raises
    ------
    ConfigurationError
        The expression is something else.
    """
    found: dict[str, int] = {}
    for factor in factors_of(expression):
        base, exponent = _base_and_exponent(factor)
        if not isinstance(base, Variable):
            raise ConfigurationError(f"{expression} is not a product of powers of parameters")
        found[base.name] = found.get(base.name, 0) + exponent
    return MappingProxyType(found)
