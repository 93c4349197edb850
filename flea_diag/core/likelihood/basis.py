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

"""Basis signals: what the effects of faults, and the differences between units, are sums of.

An effect is a row of factors on the signals, a design a column of them for each unknown.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from flea_diag.core.frozen import Frozen
from flea_diag.core.likelihood.fault_models import FaultModel, Term
from flea_diag.core.residuals.parameters import UNIT_PARAMETERS

Array = npt.NDArray[np.float64]


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


def effect_of(model: FaultModel, residual: str, sizes: Sequence[float], basis: Basis) -> Array:
    """What a fault of these sizes adds to one residual, as a factor on each basis signal."""
    factors = np.zeros(len(basis.names))
    for term in model.terms:
        if term.residual == residual:
            factors[basis.column[term.regressor]] += term.gain * sizes[term.index]
    return factors


def signals_of(
    models: Iterable[FaultModel], residuals: Sequence[str], basis: Basis
) -> npt.NDArray[np.bool_]:
    """Which signals any of these faults acts by in each residual, shape (residuals, signals)."""
    acting = np.zeros((len(residuals), len(basis.names)), dtype=bool)
    for model in models:
        for term in model.terms:
            if term.residual in residuals:
                acting[residuals.index(term.residual), basis.column[term.regressor]] = True
    return acting


class Designs(NamedTuple):
    """How sizes and unit parameters enter the residuals, of several models; not to be changed.

    Attributes
    ----------
    places
        Index of the design of each model: many models differ in their bounds alone.
    every
        The distinct ones, shape (d, residuals, signals, unknowns).
    entered
        Residuals that any of them enters: in all others every factor is 0.
    own
        ``every`` in these residuals.
    """

    places: tuple[int, ...]
    every: Array
    entered: npt.NDArray[np.int64]
    own: Array


def designs_made(
    models: tuple[FaultModel | None, ...], residuals: tuple[str, ...], basis: Basis
) -> Designs:
    """Designs of models; None is the one without a fault. What a model lacks has no effect."""
    count = max(0 if model is None else len(model.sizes) for model in models)
    distinct: dict[tuple[Term, ...], int] = {}
    terms = [() if model is None else model.terms for model in models]
    places = tuple(distinct.setdefault(each, len(distinct)) for each in terms)
    every = np.array([[_design(t, name, count, basis) for name in residuals] for t in distinct])
    entered = np.flatnonzero(every.any(axis=(0, 2, 3)))
    return Designs(places, every, entered, every[:, entered])


designs_of = lru_cache(maxsize=256)(designs_made)
"""The same, remembered: for models that are fitted again and again."""


def _design(terms: tuple[Term, ...], residual: str, count: int, basis: Basis) -> Array:
    """How sizes and unit parameters enter one residual, shape (signals, parameters)."""
    design = np.zeros((len(basis.names), count + len(basis.differences)))
    for term in terms:
        if term.residual == residual:
            design[basis.column[term.regressor], term.index] += term.gain
    for own in basis.unit_terms:
        if own.residual == residual:
            place = count + basis.differences.index(own.difference)
            design[basis.column[own.regressor], place] += own.gain
    return design
