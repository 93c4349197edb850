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

"""Which unit has started: its parameters by its first seconds, against those of the calibration.

Every relation in which healthy units differ shows them by its sensitivities (``unit_offsets``). The
sums over all relations are solved together, with a prior so wide that the data alone decide where
they say anything. A parameter has left a spread where its estimate is beyond ``SPREADS`` of it by
more than ``SURE`` of its own errors. Two spreads count: that between the recordings of the
calibration, beyond which it is another unit, and the tolerance that healthy units of the design
keep. Zeros of sensors differ from day to day and are no mark of a unit. Nor are friction and mass:
a few seconds at one speed do not part them, and a drag that is there at the start may be a fault.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from flea_diag.core.residuals.parameters import (
    UNIT_PARAMETERS,
    ZEROS,
    ActuatorParameters,
    UnitSpread,
    UnitTolerance,
)
from flea_diag.core.residuals.residual_rows import ResidualSet
from flea_diag.core.residuals.unit_difference import LEAST
from flea_diag.core.residuals.unit_offsets import OffsetLearning

Array = npt.NDArray[np.float64]
Flags = npt.NDArray[np.bool_]

WARM_UP_S = 6.0
"""Length of these first seconds."""
MARKS = (
    "winding_resistance_ohm",
    "back_emf_v_s_per_m",
    "force_constant_n_per_a",
    "drive_gain",
)
"""What tells a unit from others."""
SPREADS = 3.0
"""Of a normal distribution 0.3 % lie beyond."""
SURE = 3.0
"""The same of the errors of an estimate."""
REACH = 10.0
"""Prior of a parameter, in tolerances of healthy units."""


@dataclass(frozen=True, slots=True)
class UnitDifference:
    """By how much a parameter of the unit differs from the calibration, and the error of that.

    ``share`` of the calibrated value; ``is_beyond`` what healthy units of the design differ by.
    """

    parameter: str
    change: float
    sigma: float
    share: float
    is_beyond: bool

    def __str__(self) -> str:
        return f"{self.parameter} {self.change:+.3g} ({self.share:+.1%})"


@dataclass(frozen=True)
class UnitStart:
    """What the first seconds of a stream say of its unit.

    ``differences``: parameters beyond the spread of the calibration, the farthest first.
    ``learned``: parameter -> change from the calibrated value and its error, of another unit.
    """

    differences: tuple[UnitDifference, ...] = ()
    learned: Mapping[str, tuple[float, float]] | None = None

    @property
    def is_beyond(self) -> bool:
        """Whether no healthy unit of the design differs by so much."""
        return any(each.is_beyond for each in self.differences)

    @property
    def words(self) -> str:
        """What differs and by how much; empty for a unit as calibrated."""
        if not self.differences:
            return ""
        said = f"another unit than calibrated: {', '.join(map(str, self.differences))}"
        if self.is_beyond:
            return f"{said}; beyond what healthy units of this design differ by"
        return f"{said}; learned as its baseline"


class StartLearning:
    """Sums over the first seconds, of every relation in which healthy units differ.

    Parameters
    ----------
    known : residuals of the stand
    tolerance : what healthy units differ by
    variance : relation -> variance of a scan, in times of scans that make an independent one
    """

    def __init__(
        self, known: ResidualSet, tolerance: UnitTolerance, variance: Mapping[str, float]
    ) -> None:
        self._known, self._tolerance, self._variance = known, tolerance, variance
        self.zeros = {
            residual: OffsetLearning(name, tolerance) for residual, name in known.zeros.items()
        }
        """Of the relations that fix a zero."""
        # Of the unit alone: the relations of the zeros, and the others that units differ in.
        plain = (known.rows[j].name for j in known.spreading if not known.parities[j].normalised)
        self._others = {
            name: OffsetLearning(UNIT_PARAMETERS[0], tolerance)
            for name in plain
            if name not in self.zeros
        }

    def take(self, values: Array, spread: Array, moving: Flags) -> None:
        """Take n scans: residuals, sensitivities of ``ResidualSet.spreading``, whether it moves."""
        known = self._known
        for name, learning in (self.zeros | self._others).items():
            if name in self._variance:
                j = known.place[name]
                # A power needs no motion, and at rest an offset is all that is left of it.
                at_rest = name == known.friction and name not in known.in_motion
                use = np.ones_like(moving) if at_rest else moving
                column = known.spreading.index(j)
                learning.add(values[use, j], spread[use, column], self._variance[name])

    def estimate(self) -> tuple[Array, Array]:
        """As ``estimate``, by all these relations together."""
        return estimate([*self.zeros.values(), *self._others.values()], self._tolerance)


def estimate(learning: Sequence[OffsetLearning], tolerance: UnitTolerance) -> tuple[Array, Array]:
    """Changes of ``UNIT_PARAMETERS`` and their errors; the data alone decide."""
    if not learning:
        return np.zeros(len(UNIT_PARAMETERS)), np.full(len(UNIT_PARAMETERS), np.inf)
    widest = np.array([max(getattr(tolerance, name), LEAST) for name in UNIT_PARAMETERS])
    information, vector = (sum(parts) for parts in zip(*(e.shown for e in learning), strict=True))
    covariance = np.linalg.inv(information + np.diag(1.0 / np.square(REACH * widest)))
    return covariance @ vector, np.sqrt(np.diag(covariance))


def unit_start(
    shown: tuple[Array, Array],
    parameters: ActuatorParameters,
    tolerance: UnitTolerance,
    calibrated: UnitSpread | None,
) -> UnitStart:
    """The unit that an ``estimate`` shows.

    ``calibrated`` is the spread between units, or recordings, of the calibration; without one
    nothing tells another unit from those that it was made from.
    """
    if calibrated is None:
        return UnitStart()
    changes = list(zip(UNIT_PARAMETERS, *(part.tolist() for part in shown), strict=True))
    found = []
    for name, change, sigma in changes:
        spread, most = calibrated.spread.get(name), getattr(tolerance, name)
        surely = abs(change) - SURE * sigma
        if name not in MARKS or spread is None or not most or surely <= SPREADS * spread:
            continue
        value = getattr(parameters, name)
        share = change / value if value else 0.0
        found.append(UnitDifference(name, change, sigma, share, surely > SPREADS * most))
    if not found:
        return UnitStart()
    found.sort(key=lambda each: -abs(each.change) / getattr(tolerance, each.parameter))
    known = {
        name: (change, sigma)
        for name, change, sigma in changes
        if name in (*MARKS, *ZEROS) and sigma < getattr(tolerance, name)
    }
    return UnitStart(tuple(found), known)
