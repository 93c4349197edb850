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

"""Quantitative effect of each fault on the relations: one row of terms per fault.

A term says: in this residual the fault adds ``size[k] * gain * basis signal``. Terms follow from
the relations by differentiation (``effects``). For the FLEA (primes are true values, unprimed ones
measured):

drag dfc, dB        mechanical  r = + dfc s(v) + dB v
winding short       electrical  r = - dR i - dK v          mechanical  r = + dK i
current  i = i' + b mechanical  r = + K b                  electrical  r = - R b
current  i = g i'   the same with b = (1 - 1/g) i, the reading with its zero i0
load     F = F' + b mechanical  r = - b                    (g: b = (1 - 1/g) F)
dead     y = c      the true signal, taken from the other relation's terms, is missing from r

Sizes are bounded to the range of the catalogue: a fault that would have to be larger or of
the opposite sign does not explain the residual.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Term:
    """``size[index] * gain * regressor`` in one residual; the regressor is a name of the basis."""

    residual: str
    regressor: str
    gain: float
    index: int = 0


@dataclass(frozen=True, slots=True)
class Size:
    """One size parameter of a fault: what it is, its unit and its bounds.

    ``limit`` is that of the end of life; infinite: none is stated.
    """

    name: str
    unit: str
    low: float
    high: float
    limit: float = math.inf


@dataclass(frozen=True, slots=True, eq=False)
class FaultModel:
    """Additive model of one fault in the parity relations; equal to itself alone.

    ``roughness`` is the scatter of the fault's own effect, as a share of it: friction of a rubbing
    screw varies along the stroke, a sensor's scale factor does not. ``channel`` is the one whose
    reading errs; empty: none does.
    """

    fault: str
    sizes: tuple[Size, ...]
    terms: tuple[Term, ...]
    roughness: float = 0.0
    channel: str = ""


def moved_by(models: Iterable[FaultModel]) -> frozenset[str]:
    """Residuals that any of these models moves."""
    return frozenset(term.residual for model in models for term in model.terms)
