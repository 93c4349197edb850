"""Basis signals: what the effects of faults, and the differences between units, are sums of."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

from flea_diag.core.frozen import Frozen
from flea_diag.core.residuals.parameters import UNIT_PARAMETERS


@dataclass(frozen=True, slots=True)
class UnitTerm:
    """``difference * gain * regressor`` in one residual, for what healthy units differ by."""

    residual: str
    difference: str
    regressor: str
    gain: float


@dataclass(frozen=True, eq=False)
class Basis(Frozen):
    """Names of the basis signals, in the order of every row of regressors, and the unit terms.

    ``differences`` is what healthy units differ by, in the order of every tolerance.
    """

    names: tuple[str, ...]
    unit_terms: tuple[UnitTerm, ...] = ()
    differences: tuple[str, ...] = UNIT_PARAMETERS

    @cached_property
    def column(self) -> dict[str, int]:
        """Place of each signal."""
        return {name: place for place, name in enumerate(self.names)}
