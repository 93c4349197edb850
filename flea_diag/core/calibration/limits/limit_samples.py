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

"""What every test is fitted to: the residuals of nominal recordings, and what units differ by."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from flea_diag.core.calibration.nominal_trace import Trace
from flea_diag.core.residuals.parameters import UNIT_PARAMETERS, UnitTolerance
from flea_diag.core.residuals.residual_rows import ReadingTerm, ResidualRow, ResidualSet
from flea_diag.core.residuals.thermal import CORRECTION_S
from flea_diag.core.scan_counts import ScanCounts

Array = npt.NDArray[np.float64]
Flags = npt.NDArray[np.bool_]

PIECE_S = 10.0  # assumption: size of a sample
SHIFT_SHARE = 0.1
"""Share of the false-alarm rate allotted to mean-shift tests."""
LEARNED = ("voltage_offset_v", "current_offset_a")
"""What a diagnosis learns of the unit in its first seconds."""


@dataclass(frozen=True)
class LimitSamples:
    """What all tests of one calibration share."""

    traces: Sequence[Trace]
    judged: Sequence[Trace]
    others: Flags
    tolerance: UnitTolerance
    rate_per_hour: float
    period_s: float
    spread: Mapping[str, tuple[float, ...]]
    terms: Sequence[ReadingTerm]

    @property
    def rows(self) -> ResidualSet:
        """The residuals of the stand."""
        return self.traces[0].rows

    @property
    def counts(self) -> ScanCounts:
        """Counts of scans at their rate."""
        return ScanCounts(self.period_s)

    def differing_of(self, units: Sequence[int]) -> Array:
        """Spread of healthy units in some parameters, before anything is learned."""
        return np.array([getattr(self.tolerance, UNIT_PARAMETERS[k]) for k in units])

    @property
    def differing(self) -> Array:
        """Spread of healthy units by parameter, without what a diagnosis learns."""
        sigmas = (0.0 if n in LEARNED else getattr(self.tolerance, n) for n in UNIT_PARAMETERS)
        return np.array(list(sigmas))

    def student(self, rate_per_hour: float, window: int, samples: int) -> float:
        """Limit of a test that shares ``rate_per_hour``, from so many nominal samples."""
        pieces = samples * self.period_s / PIECE_S
        alpha = rate_per_hour * window * self.period_s / 3600.0
        return _student(alpha, max(pieces - 1.0, 2.0))

    def extra(self, row: ResidualRow) -> float:
        """Variance that units differ by in every scan alike: of heating rates, of innovations."""
        if row.name in self.spread:
            return float(np.square(np.array(self.spread[row.name]) * self.differing).sum())
        return (self.tolerance.thermal_rate_k_per_s * CORRECTION_S) ** 2 * (
            row.name in self.rows.predictions
        )


def spread_of(entry: Trace, column: int) -> Array:
    """D r / d theta of healthy units, shape (scans, unit parameters); 0 where they are alike."""
    if entry.spread is None or column not in entry.rows.spreading:
        return np.zeros((len(entry.values), len(UNIT_PARAMETERS)))
    return np.nan_to_num(entry.spread[:, entry.rows.spreading.index(column)])


def _student(alpha: float, degrees: float) -> float:
    from scipy.special import stdtrit

    return float(-stdtrit(degrees, min(alpha, 0.5) / 2.0))
