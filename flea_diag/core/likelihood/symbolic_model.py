"""A fault model before its numbers: gains and bounds in the base parameters of a calibration."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass

from flea_diag.core.likelihood.effects import Effects
from flea_diag.core.likelihood.fault_models import FaultModel, Size, Term
from flea_diag.core.symbolic.expression import Expression, evaluate


@dataclass(frozen=True, slots=True)
class SymbolicSize:
    """One size; bounds in multiples of the base parameter ``of``, absolute without one.

    ``least`` takes the place of ``low`` where the fault has shown itself in vibration alone.
    """

    name: str
    unit: str
    low: float
    high: float
    least: float
    of: str = ""

    def bound(self, values: Mapping[str, float], is_vibration_only: bool) -> Size:
        """With the parameters of one calibration."""
        low = self.least if is_vibration_only else self.low
        unit = values[self.of] if self.of else 1.0
        # Infinity stays so, of a parameter that is zero as well.
        high = self.high if math.isinf(self.high) else self.high * unit
        return Size(self.name, self.unit, low if math.isinf(low) else low * unit, high)


@dataclass(frozen=True, slots=True)
class SymbolicModel:
    """One alternative of one fault; see ``FaultModel``."""

    fault: str
    sizes: tuple[SymbolicSize, ...]
    effects: Effects
    roughness: float = 0.0
    vibration_only: bool = False

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
        sizes = tuple(size.bound(values, is_vibration_only) for size in self.sizes)
        return FaultModel(self.fault, sizes, tuple(t for t in terms if t.gain), self.roughness)
