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

"""The units that recordings are of: what is left out together, and by what healthy units differ.

What tells another unit is held against more than that: the first seconds of a recording see a
parameter through all that the relations lack in its motion (``with_starts``).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from flea_diag.core.calibration.calibration import Calibration
from flea_diag.core.calibration.identified import Identified
from flea_diag.core.calibration.nominal_trace import Trace
from flea_diag.core.calibration.run_spread import (
    LEAST_UNITS,
    are_one,
    joined,
    measured_spread,
    recorded_spread,
    tolerance_of,
)
from flea_diag.core.likelihood.unit_start import MARKS, WARM_UP_S, StartLearning
from flea_diag.core.residuals.parameters import UNIT_PARAMETERS, UnitSpread, UnitTolerance
from flea_diag.core.residuals.relation_set import RelationSet
from flea_diag.tools.calibrate.nominal_recording import NominalRecording


def folds_of(recordings: Sequence[NominalRecording]) -> tuple[str, ...]:
    """What each recording is left out with: its unit where there are enough, else itself."""
    if _known_units(recordings):
        return tuple(recording.serial for recording in recordings)
    return tuple(recording.run.name for recording in recordings)


def units_of(
    recordings: Sequence[NominalRecording], found: Identified, relations: RelationSet
) -> tuple[UnitSpread, UnitTolerance, tuple[str, ...]]:
    """Measured spread, tolerance of healthy units, and serial numbers that are of one unit."""
    stated = tolerance_of(found.parameters, relations)
    units = measured_spread(found.folds if _known_units(recordings) else (), stated)
    serials = sorted({recording.serial for recording in recordings} - {""})
    alike = tuple(serials) if are_one(units, stated) else ()
    if alike or len(serials) == 1:
        units = recorded_spread(found.sigmas, len(recordings))
    return units, joined(stated, units), alike


def with_starts(units: UnitSpread, calibration: Calibration, traces: Sequence[Trace]) -> UnitSpread:
    """The spread of what marks a unit, at least that of the first seconds of its recordings.

    Each is judged by the parameters of the others, as a diagnosis judges a recording, and counts
    with what noise does not explain of it.
    """
    scans = round(WARM_UP_S / calibration.period_s)
    excess: dict[str, list[float]] = {name: [] for name in MARKS}
    for trace in traces:
        start = StartLearning(trace.rows, calibration.tolerance, calibration.variances)
        assert trace.spread is not None
        start.take(trace.values[:scans], trace.spread[:scans], trace.moving[:scans])
        for name, change, sigma in zip(UNIT_PARAMETERS, *start.estimate(), strict=True):
            if name in excess and sigma < getattr(calibration.tolerance, name):
                excess[name].append(change**2 - sigma**2)
    shown = {
        name: math.sqrt(max(0.0, float(np.mean(squares))))
        for name, squares in excess.items()
        if squares
    }
    spread = {name: max(known, shown.get(name, 0.0)) for name, known in units.spread.items()}
    return replace(units, spread=spread)


def _known_units(recordings: Sequence[NominalRecording]) -> bool:
    """Whether all units are known by their serial numbers, and enough of them."""
    units = {recording.serial for recording in recordings}
    return "" not in units and len(units) >= LEAST_UNITS
