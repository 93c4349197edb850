"""Ends of the recorded travel: what a relation neglects at one place raises its limit there alone.

A recording that comes farther than the others shows what is off at its place and nowhere else. So
the travel has three stretches: the middle, to which several recordings came, and an end on either
side of it. At an end a residual is divided by a factor of its own before it is tested.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Annotated

import numpy as np
import numpy.typing as npt

from flea_diag.core.frozen import Frozen
from flea_diag.fields.values import within

Array = npt.NDArray[np.float64]

Factor = Annotated[float, within(1.0, 1e6)]


@dataclass(frozen=True)
class TravelFactors(Frozen):
    """Edges of the middle, and the factors of each residual below, in and above it."""

    edges: tuple[float, float]
    factors: Mapping[str, tuple[Factor, Factor, Factor]]

    def table(self, names: Sequence[str]) -> Array:
        """Factors of these residuals, shape (3, residuals); 1 where none is known."""
        return np.array([self.factors.get(name, (1.0, 1.0, 1.0)) for name in names]).T


def stretches(position: Array, edges: tuple[float, float]) -> npt.NDArray[np.int64]:
    """Stretch of each position: 0, 1, 2; a reading that is missing lies in the middle."""
    low, high = edges
    return 1 - (position < low) + (position > high)
