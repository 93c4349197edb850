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

"""Base parameters: the products of physical parameters that recordings can identify.

Current, voltage, position and load fix the product of torque constant and screw ratio, and
neither of the two. As in the identification of robots (Gautier 1991), the relations are written
in such products. A description names them, the calibration holds their values, and a parameter
that no recording fixes cancels out of every relation. A factor of a product may be a sum, such as
the capacity of stores that are lumped into one.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from types import MappingProxyType
from typing import Any

import numpy as np

from flea_diag.core.symbolic.collect import exponents, monomial, terms_of
from flea_diag.core.symbolic.expression import (
    Expression,
    Sum,
    Variable,
    product,
    rewritten,
    symbols,
)
from flea_diag.core.symbolic.unit import product_unit
from flea_diag.errors import ConfigurationError, shown
from flea_diag.fields.reader import read_as


def base_parameters(
    content: Any, parameters: Collection[str], where: str
) -> Mapping[str, Expression]:
    """Name -> product of powers of physical parameters, as a description gives it.

    Raises
    ------
    ConfigurationError
        A definition is no such product, names no parameter of the graph, or the definitions do
        not fix each of the parameters in them.
    """
    found = {}
    for name, text in read_as(dict[str, str], content, where).items():
        found[name] = monomial(text)
        odd = [used for used in symbols(found[name]) if used not in parameters]
        if odd:
            raise ConfigurationError(f"{where}: {shown(name)} holds {shown(odd[0])}, no parameter")
        if not name.isidentifier() or (name in parameters and found[name] != Variable(name)):
            raise ConfigurationError(
                f"{where}: {shown(name)} must be a name that no other parameter has"
            )
    in_base(found, where)
    return MappingProxyType(found)


def in_base(definitions: Mapping[str, Expression], where: str = "") -> dict[Expression, Expression]:
    """Physical parameter, or sum of them -> the same in base parameters: the definitions, solved.

    Raises
    ------
    ConfigurationError
        They are not as many as the parameters in them, or depend on each other.
    """
    sums: dict[str, Expression] = {}
    powers = {
        name: exponents(rewritten(definition, lambda node: _named(node, sums)))
        for name, definition in definitions.items()
    }
    physical = list(dict.fromkeys(name for row in powers.values() for name in row))
    matrix = np.array([[row.get(name, 0) for name in physical] for row in powers.values()], float)
    if len(powers) != len(physical) or np.linalg.matrix_rank(matrix) < len(physical):
        raise ConfigurationError(
            f"{where}: {len(powers)} products do not fix the {len(physical)} parameters in them"
            f" ({', '.join(str(sums.get(name, name)) for name in physical)}); name as many"
            " independent ones"
        )
    inverse = np.linalg.inv(matrix) if physical else matrix
    whole = np.rint(inverse).astype(int)
    if physical and not np.allclose(inverse, whole):
        raise ConfigurationError(f"{where}: a parameter would be a root of the products; rename")
    return {
        sums.get(name, Variable(name)): product(
            Variable(base) ** int(n) for base, n in zip(powers, row, strict=True)
        )
        for name, row in zip(physical, whole, strict=True)
    }


def unit_of(definition: Expression, units: Mapping[str, str]) -> str:
    """Unit of a base parameter, of those of the physical parameters in it; a name keeps its own.

    It is what the description makes it: of a torque on a joint, of a force behind a screw.
    """
    if isinstance(definition, Variable):
        return units[definition.name]
    sums: dict[str, Expression] = {}
    factors = exponents(rewritten(definition, lambda node: _named(node, sums)))
    units = {**units, **{name: unit_of(terms_of(e)[0], units) for name, e in sums.items()}}
    return product_unit((units[name], times) for name, times in factors.items())


def _named(node: Expression, sums: dict[str, Expression]) -> Expression:
    """A sum by a name of its own, kept in ``sums``."""
    if not isinstance(node, Sum):
        return node
    name = next((n for n, e in sums.items() if same_sum(e, node)), f"sum of {len(sums)}")
    sums.setdefault(name, node)
    return Variable(name)


def same_sum(one: Expression, other: Expression) -> bool:
    """Whether two expressions are sums of the same terms, in any order."""
    if not isinstance(one, Sum) or not isinstance(other, Sum):
        return False
    return set(one.terms) == set(other.terms)


def rewritten_in(expression: Expression, known: Mapping[Expression, Expression]) -> Expression:
    """The expression with parameters and sums of them replaced, see ``in_base``."""

    def change(node: Expression) -> Expression:
        if isinstance(node, Sum):
            return next((new for old, new in known.items() if same_sum(old, node)), node)
        return known.get(node, node)

    return rewritten(expression, change)
