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

"""Regression of base parameters on a relation that runs: r(s; theta) = 0 on nominal recordings.

A relation that is linear in its unknown parameters gives one column for each of them, its
derivative. One that is not, because a trusted term has an unknown coefficient of its own (the
motor's force constant), is divided by that coefficient: the quotients are what the columns
determine, and products of their powers are the parameters.

What recordings do not fix shows in the rank of the columns: a load that never changes, a speed that
is always the same. What no recording could fix shows in the quotients: a weight and the zero of the
current's sensor act alike. The zero then keeps the description's value. Where quotients are more
than parameters, or sums of them, the parameters are those that fit the quotients best.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Any

import numpy as np
import numpy.typing as npt
from scipy.linalg import qr

from flea_diag.core.bond_graph.base_parameters import in_base
from flea_diag.core.residuals.relation_set import CompiledRelation
from flea_diag.core.symbolic.collect import collect, divided, factors_of
from flea_diag.core.symbolic.expression import (
    ONE,
    ZERO,
    Constant,
    Expression,
    Power,
    Variable,
    derivative,
    evaluate,
    product,
    substitute,
    symbols,
)
from flea_diag.errors import CalibrationError

Array = npt.NDArray[np.float64]
Signals = Mapping[str, Array]

LEAST_LEFT = 1e-6
"""Share of a column that the others must leave: with less of it rounding would decide."""
NEWTON_STEPS = 30  # far more than any quotient has needed: it converges in a few
TINY = 1e-6
"""Start of a parameter whose value is said to be 0."""


@dataclass(frozen=True)
class Regression:
    """y = A x, and the parameters as expressions in x.

    ``columns`` has shape (n, k) and ``target`` (n,); x is named ``names``. ``quotients`` are x in
    parameters. ``unscaled`` are those of the regressand where every other term has an unknown
    coefficient, too: then quotients alone are determined, and no parameter is before these are
    known.
    """

    columns: Array
    target: Array
    names: tuple[str, ...]
    parameters: Mapping[str, Expression]
    quotients: Mapping[str, Expression]
    unscaled: tuple[str, ...] = ()
    start: Mapping[str, float] = field(default_factory=dict)
    """Parameters to start from where ``parameters`` is empty: no formula gives them."""

    def not_fixed(self) -> tuple[str, ...]:
        """Parameters that the columns leave open, each alone in a column of which that is so.

        Columns of unit length are eliminated largest first (QR with pivoting); what is then left of
        a column is what only it says.

        Raises
        ------
        CalibrationError
            Such a column holds no parameter of its own, so that nothing can be kept at its default.
        """
        if self.unscaled:
            return self.unscaled
        length = np.linalg.norm(self.columns, axis=0)
        R, order = qr(self.columns / np.where(length > 0.0, length, 1.0), mode="r", pivoting=True)
        left = np.abs(np.diag(R[: len(order)]))
        return tuple(self._own(self.names[k]) for k in order[left < LEAST_LEFT])

    def _own(self, name: str) -> str:
        """The parameter that occurs in this quotient and in no other."""
        others = {p for n, e in self.quotients.items() if n != name for p in symbols(e)}
        own = [p for p in symbols(self.quotients[name]) if p not in others]
        if not own:
            shared = ", ".join(symbols(self.quotients[name]))
            raise CalibrationError(
                f"the recordings do not fix {shared}: what it acts on never changes by itself; "
                "record motions under different loads, both ways and at different speeds"
            )
        return own[0]

    def solved(self, x: Array, covariance: Array) -> tuple[dict[str, float], Array]:
        """Parameters of a solution, and their covariance by the gradient there (k, k)."""
        if self.start:
            return self._nearest(x, covariance)
        point = dict(zip(self.names, map(float, x), strict=True))
        values = {name: float(evaluate(e, point)) for name, e in self.parameters.items()}
        gradient = np.array(
            [
                [float(evaluate(derivative(e, name), point)) for name in self.names]
                for e in self.parameters.values()
            ]
        )
        return values, gradient @ covariance @ gradient.T

    def _nearest(self, x: Array, covariance: Array) -> tuple[dict[str, float], Array]:
        """Parameters whose quotients are nearest to x in its errors (Gauss and Newton)."""
        errors = np.sqrt(np.diag(covariance))
        weight = 1.0 / np.where(errors > 0.0, errors, 1.0)
        point, back = dict(self.start), np.zeros((len(self.start), len(x)))
        for _ in range(NEWTON_STEPS):
            slopes = _slopes(self.quotients.values(), point)
            scale = np.linalg.norm(slopes * weight[:, None], axis=0)
            scale[scale == 0.0] = 1.0
            back = np.linalg.pinv(slopes * weight[:, None] / scale) * weight / scale[:, None]
            off = x - [float(evaluate(e, point)) for e in self.quotients.values()]
            step = back @ off
            point = {n: point[n] + float(d) for n, d in zip(point, step, strict=True)}
        return point, back @ covariance @ back.T


def _slopes(quotients: Iterable[Expression], point: Mapping[str, float]) -> Array:
    """D quotient / d parameter, shape (quotients, parameters)."""
    rows = [[float(evaluate(derivative(e, name), point)) for name in point] for e in quotients]
    return np.array(rows).reshape(-1, len(point))


def regression(
    relation: CompiledRelation,
    known: Mapping[str, float],
    regressand: str,
    signals: Signals,
    use: npt.NDArray[np.bool_],
    start: Mapping[str, float] = MappingProxyType({}),
    yielding: Collection[str] = (),
) -> Regression:
    """Regression of the parameters of a relation that are not ``known``.

    Parameters
    ----------
    regressand
        Signal whose term stands alone on the left.
    signals
        Columns by name, shape (n,), of which the rows ``use`` count.
    start
        Values near those of the parameters, for quotients that no formula solves.
    yielding
        Parameters that are taken as known before others where both act alike.
    """
    fixed = {name: Constant(value) for name, value in known.items()}
    expression = substitute(relation.expression, fixed)
    unknown = [name for name in symbols(expression) if name not in relation.signals]
    values = {name: signals[name][use] for name in relation.signals}
    count = int(use.sum())
    slopes = [derivative(expression, name) for name in unknown]
    own_slope = derivative(expression, regressand)
    if not any(set(symbols(slope)) & set(unknown) for slope in (*slopes, own_slope)):
        sign = 1.0 if float(evaluate(own_slope, {})) > 0.0 else -1.0
        rest = substitute(expression, dict.fromkeys(unknown, ZERO))
        columns = [-sign * _column(slope, values, count) for slope in slopes]
        target = sign * _column(rest, values, count)
        own = {name: Variable(name) for name in unknown}
        return Regression(np.stack(columns, axis=1), target, tuple(unknown), own, own)
    return _of_quotients(expression, regressand, values, count, start, yielding)


def _of_quotients(
    expression: Expression,
    regressand: str,
    values: Mapping[str, Array],
    count: int,
    start: Mapping[str, float],
    yielding: Collection[str],
) -> Regression:
    """Each term over that of the regressand, its number with the column."""
    terms = dict(collect(expression, tuple(values)))
    own = terms.pop(Variable(regressand))
    columns: dict[Expression, Array] = {}
    for basis, coefficient in terms.items():
        factor, monomial = parted(divided(-coefficient / own))
        columns[monomial] = columns.get(monomial, 0.0) + factor * _column(basis, values, count)
    target = _column(Variable(regressand), values, count) - columns.pop(ONE, 0.0)
    quotients = {f"x_{number}": monomial for number, monomial in enumerate(columns)}
    stacked = np.stack([*columns.values()], axis=1) if columns else np.empty((count, 0))
    return of_quotients(stacked, target, quotients, start, (*yielding, *symbols(own)))


def of_quotients(
    columns: Array,
    target: Array,
    quotients: Mapping[str, Expression],
    start: Mapping[str, float],
    yielding: Collection[str] = (),
) -> Regression:
    """Regression of quotients with a column each, see ``regression``.

    It is ``unscaled`` as long as they leave a parameter open, whatever is recorded.
    """
    names = tuple(quotients)
    loose = _alike(quotients, yielding)
    if loose:
        return Regression(columns, target, names, {}, quotients, (loose,))
    if _are_monomials(quotients):
        solved = {str(name): form for name, form in in_base(quotients, "quotients").items()}
        return Regression(columns, target, names, solved, quotients)
    used = dict.fromkeys(n for quotient in quotients.values() for n in symbols(quotient))
    near = {name: start.get(name, 1.0) or TINY for name in used}
    return Regression(columns, target, names, {}, quotients, (), near)


def _are_monomials(quotients: Mapping[str, Expression]) -> bool:
    """Whether the quotients are products of powers, as many as there are parameters in them."""
    names = {name for quotient in quotients.values() for name in symbols(quotient)}
    bases = (
        f.base if isinstance(f, Power) else f for q in quotients.values() for f in factors_of(q)
    )
    return len(names) == len(quotients) and all(isinstance(base, Variable) for base in bases)


def _alike(quotients: Mapping[str, Expression], first: Collection[str]) -> str:
    """A parameter that no recording tells from the others, of ``first`` if one is; else empty.

    Its column of the slopes depends on those of the others, at any point.
    """
    names = dict.fromkeys(n for quotient in quotients.values() for n in symbols(quotient))
    point = {name: 1.0 + 0.37 * number for number, name in enumerate(names)}
    slopes = _slopes(quotients.values(), point)
    rank = np.linalg.matrix_rank(slopes) if slopes.size else 0
    if rank == len(names):
        return ""
    for name in (*(n for n in first if n in names), *reversed(names)):
        column = list(names).index(name)
        if np.linalg.matrix_rank(np.delete(slopes, column, axis=1)) == rank:
            return name
    return ""


def parted(quotient: Expression) -> tuple[float, Expression]:
    """Number and product of parameters of a quotient; a sum of them has the number 1."""
    factors = factors_of(quotient)
    numbers = [factor for factor in factors if isinstance(factor, Constant)]
    number = float(np.prod([factor.value for factor in numbers])) if numbers else 1.0
    return number, product([f for f in factors if not isinstance(f, Constant)] or [ONE])


def _column(expression: Expression, values: Mapping[str, Any], count: int) -> Array:
    return np.broadcast_to(np.asarray(evaluate(expression, values), dtype=float), (count,)).copy()
