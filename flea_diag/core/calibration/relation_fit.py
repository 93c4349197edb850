"""Regression of base parameters on a relation that runs: r(s; theta) = 0 on nominal recordings.

A relation that is linear in its unknown parameters gives one column for each of them, its
derivative. One that is not, because a trusted term has an unknown coefficient of its own (the
motor's force constant), is divided by that coefficient: the quotients are what the columns
determine, and products of their powers are the parameters.

What recordings do not fix shows in the rank of the columns: a load that never changes, a speed that
is always the same.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt
from scipy.linalg import qr

from flea_diag.core.bond_graph.base_parameters import in_base
from flea_diag.core.residuals.relation_set import CompiledRelation
from flea_diag.core.symbolic.collect import collect, factors_of
from flea_diag.core.symbolic.expression import (
    ONE,
    ZERO,
    Constant,
    Expression,
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
        point = dict(zip(self.names, map(float, x), strict=True))
        values = {name: float(evaluate(e, point)) for name, e in self.parameters.items()}
        gradient = np.array(
            [
                [float(evaluate(derivative(e, name), point)) for name in self.names]
                for e in self.parameters.values()
            ]
        )
        return values, gradient @ covariance @ gradient.T


def regression(
    relation: CompiledRelation,
    known: Mapping[str, float],
    regressand: str,
    signals: Signals,
    use: npt.NDArray[np.bool_],
) -> Regression:
    """Regression of the parameters of a relation that are not ``known``.

    Parameters
    ----------
    regressand
        Signal whose term stands alone on the left.
    signals
        Columns by name, shape (n,), of which the rows ``use`` count.
    """
    fixed = {name: Constant(value) for name, value in known.items()}
    expression = substitute(relation.expression, fixed)
    unknown = [name for name in symbols(expression) if name not in relation.signals]
    values = {name: signals[name][use] for name in relation.signals}
    count = int(use.sum())
    slopes = [derivative(expression, name) for name in unknown]
    if not any(set(symbols(slope)) & set(unknown) for slope in slopes):
        sign = 1.0 if float(evaluate(derivative(expression, regressand), {})) > 0.0 else -1.0
        rest = substitute(expression, dict.fromkeys(unknown, ZERO))
        columns = [-sign * _column(slope, values, count) for slope in slopes]
        target = sign * _column(rest, values, count)
        own = {name: Variable(name) for name in unknown}
        return Regression(np.stack(columns, axis=1), target, tuple(unknown), own, own)
    return _of_quotients(expression, regressand, values, count)


def _of_quotients(
    expression: Expression, regressand: str, values: Mapping[str, Array], count: int
) -> Regression:
    """Each term over that of the regressand, its number with the column."""
    terms = dict(collect(expression, tuple(values)))
    own = terms.pop(Variable(regressand))
    columns: dict[Expression, Array] = {}
    for basis, coefficient in terms.items():
        factor, monomial = _parted(-coefficient / own)
        columns[monomial] = columns.get(monomial, 0.0) + factor * _column(basis, values, count)
    target = _column(Variable(regressand), values, count) - columns.pop(ONE, 0.0)
    quotients = {f"x_{number}": monomial for number, monomial in enumerate(columns)}
    stacked = np.stack(list(columns.values()), axis=1)
    if len({name for monomial in quotients.values() for name in symbols(monomial)}) > len(
        quotients
    ):
        return Regression(stacked, target, tuple(quotients), {}, quotients, tuple(symbols(own)))
    solved = {str(name): form for name, form in in_base(quotients, "quotients").items()}
    return Regression(stacked, target, tuple(quotients), solved, quotients)


def _parted(quotient: Expression) -> tuple[float, Expression]:
    """Number and product of parameters of a quotient."""
    factors = factors_of(quotient)
    numbers = [factor for factor in factors if isinstance(factor, Constant)]
    number = float(np.prod([factor.value for factor in numbers])) if numbers else 1.0
    return number, product([f for f in factors if not isinstance(f, Constant)] or [ONE])


def _column(expression: Expression, values: Mapping[str, Any], count: int) -> Array:
    return np.broadcast_to(np.asarray(evaluate(expression, values), dtype=float), (count,)).copy()
