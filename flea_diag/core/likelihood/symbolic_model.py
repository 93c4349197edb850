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

"""A fault model before its numbers: gains and bounds in the base parameters of a calibration."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass

from flea_diag.core.faults.effect_row import SizeBounds
from flea_diag.core.likelihood.effects import Effects
from flea_diag.core.likelihood.fault_models import FaultModel, Size, Term
from flea_diag.core.symbolic.expression import Expression, evaluate


@dataclass(frozen=True, slots=True)
class SymbolicModel:
    """One alternative of one fault; see ``FaultModel``."""

    fault: str
    sizes: tuple[SizeBounds, ...]
    effects: Effects
    roughness: float = 0.0
    vibration_only: bool = False
    channel: str = ""

    @property
    def has_least(self) -> bool:
        """Whether it says what the fault adds where only vibration deviates."""
        return self.vibration_only or any(size.least != size.low for size in self.sizes)

    def bound(
        self,
        values: Mapping[str, float],
        name_of: Callable[[Expression], str],
        is_vibration_only: bool = False,
    ) -> FaultModel:
        """With the parameters of one calibration, terms that are zero there left out."""
        terms = (
            Term(e.residual, name_of(e.basis), float(evaluate(e.gain, values)), e.index)
            for e in self.effects
        )
        sizes = tuple(_bound(size, values, is_vibration_only) for size in self.sizes)
        acting = tuple(term for term in terms if term.gain)
        return FaultModel(self.fault, sizes, acting, self.roughness, self.channel)


def _bound(size: SizeBounds, values: Mapping[str, float], is_vibration_only: bool) -> Size:
    """A size with the parameters of one calibration; infinity stays so, also of one that is 0."""
    unit = values[size.of] if size.of else 1.0
    ends = size.least if is_vibration_only else size.low, size.high
    low, high, limit = (end if math.isinf(end) else end * unit for end in (*ends, size.limit))
    return Size(size.name, size.unit, low, high, limit)
