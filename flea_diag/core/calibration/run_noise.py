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

"""What a relation scatters by within one run, and what its unit's parameters may differ by in it.

The scatter of windowed means over recordings (``ResidualLimit``) holds what recordings differ by. A
likelihood allows for that by the parameters of the unit as well, which counts it twice. Where
coefficients are tested, a calibration knows the noise of a sample sigma that these parameters leave
of each recording. A shift over w has the noise of its window and of the level of up to b before it,

    sigma_d^2 = c sigma^2 (1 / w + 1 / b) ,

which gives the samples c to one independent sample, for the window with the largest. What this
leaves out, a parameter by which recordings of one unit differ, is no less than its tolerance.
"""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass, replace

from flea_diag.core.calibration.calibration import Calibration
from flea_diag.core.calibration.run_spread import LEAST_UNITS, recorded_spread
from flea_diag.core.detection.mean_shift import REFERENCE_S
from flea_diag.core.residuals.parameters import UnitSpread, UnitTolerance


@dataclass(frozen=True)
class RunNoise:
    """Noise of a sample, samples to one independent sample, and what units may differ by."""

    sigma: float
    correlation: float
    tolerance: UnitTolerance


def run_noise(calibration: Calibration, relation: str, units: Collection[str]) -> RunNoise | None:
    """Noise of a relation in which parameters ``units`` act; None where recordings say more of it.

    That is without tests of its coefficients, and where its level wanders within a run by more than
    the parameters of its unit explain, as with the heat of a winding: c is then the larger one.
    """
    limit = calibration.limit(relation)
    noises = [s.sigma for s in calibration.shifts if s.name == relation and s.along]
    shifts = [s for s in calibration.mean_shifts if s.name == relation]
    if limit is None or not noises or not shifts:
        return None
    sigma, before = min(noises[0], limit.sigma[0]), calibration.counts.of(REFERENCE_S)
    level = max(s.sigma**2 / (1.0 / s.window + 1.0 / before) for s in shifts)
    correlation = max(level / sigma**2, 1.0)
    if correlation >= limit.correlation_samples:
        return None
    return RunNoise(sigma, correlation, _tolerance(calibration, units))


def _tolerance(calibration: Calibration, units: Collection[str]) -> UnitTolerance:
    """That of the calibration, at least what its recordings differ by if they tell no units.

    Units of one design differ by no less than runs of one of them.
    """
    stated = calibration.tolerance
    if (calibration.units or UnitSpread()).count >= LEAST_UNITS:
        return stated
    recorded = recorded_spread(calibration.sigmas, len(calibration.sources)).spread
    wider = {name: max(s, getattr(stated, name)) for name, s in recorded.items() if name in units}
    return replace(stated, **wider)
