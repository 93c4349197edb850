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

"""Detectability: faults that a stand cannot show at any size, so that it can say so.

A sensor fault is detectable by a test of that sensor alone (``sensor_tests``), by a relation whose
terms vary or grow with it, or by a constant offset of a relation above the limit of its test. A
fault that only adds a constant below every limit is not detectable: the drift of a single position
sensor, whose slope is also the only speed, enters the relations as ``-B d`` and ``-Ke d``. A fault
of the plant is not detectable where the channels of the stand close no relation that holds it.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

from flea_diag.core.calibration.calibration import Calibration
from flea_diag.core.faults.fault import Fault
from flea_diag.core.faults.sensor_symptoms import SensorSymptoms
from flea_diag.core.isolation.predicted_symbols import JUMP_MODES, OWN_TESTS
from flea_diag.core.likelihood.fault_models import FaultModel
from flea_diag.core.run_law.run_law import VisibleSize

CONSTANT = "one"
UNDETECTABLE = (
    "not detectable at any size with these sensors; a second sensor of the same quantity would "
    "show it"
)
TOO_WIDE = (
    "no size of the catalogue reaches a limit of this calibration; more nominal running, or a "
    "sensor nearer to it, would show it"
)


def undetectable(
    faults: Mapping[str, Fault],
    models: Sequence[FaultModel],
    calibration: Calibration,
    sensors: SensorSymptoms,
) -> tuple[str, ...]:
    """Sensor faults of the calibrated stand that none of its tests can detect."""
    reach = smallest_detectable_offsets(calibration)
    return tuple(
        name
        for name, fault in faults.items()
        if fault.channel in calibration.channels
        and not tested_alone(fault, sensors)
        and not any(_is_detectable(model, reach) for model in models if model.fault == name)
    )


def without_relation(
    faults: Mapping[str, Fault], models: Sequence[FaultModel], calibration: Calibration
) -> tuple[Fault, ...]:
    """Faults of the plant that no tested relation of the stand holds.

    Those that move no relation of any stand and show in vibration alone are not among them.
    """
    reach = smallest_detectable_offsets(calibration)
    held = {m.fault for m in models if any(term.residual in reach for term in m.terms)}
    return tuple(
        fault
        for name, fault in faults.items()
        if name not in held and not fault.channel and (fault.effects or not fault.vibration)
    )


def smallest_detectable_offsets(calibration: Calibration) -> dict[str, float]:
    """Smallest constant offset of each residual that one of its tests detects, in its unit."""
    found: dict[str, float] = {}
    for limit in calibration.limits:
        found[limit.name] = min(row.k * min(row.sigma) for row in limit.windows)
    for shift in calibration.mean_shifts:
        found[shift.name] = min(found.get(shift.name, shift.k * shift.sigma), shift.k * shift.sigma)
    return found


def unseen_by_limits(visible: Sequence[VisibleSize]) -> tuple[str, ...]:
    """Faults of which no size within the catalogue reaches a limit."""
    rows = [row for row in visible if row.limits <= row.largest]
    seen = {row.fault for row in rows}
    return tuple(dict.fromkeys(row.fault for row in visible if row.fault not in seen))


def unseen(
    faults: Mapping[str, Fault], visible: Sequence[VisibleSize], sensors: SensorSymptoms
) -> dict[str, str]:
    """Faults that no size within the catalogue lets the law see, each with the reason.

    What a test of its sensor alone shows, or vibration, the law need not see.
    """
    seen = {row.fault for row in visible if row.onset <= row.largest}
    at_all = {row.fault for row in visible if math.isfinite(row.onset)}
    return {
        row.fault: TOO_WIDE if row.fault in at_all else UNDETECTABLE
        for row in visible
        if row.fault in faults and row.fault not in seen
        if not (faults[row.fault].vibration or tested_alone(faults[row.fault], sensors))
    }


def shows_from(visible: Sequence[VisibleSize], by_law: bool = False) -> tuple[tuple[str, str], ...]:
    """Fault and the sizes from which on half of the calibration's recordings would show it.

    By the limits of the tests of every residual, or ``by_law`` by the evidence.
    """
    found: dict[str, list[str]] = {}
    for row in visible:
        size = row.onset if by_law else row.limits
        if size <= row.largest:
            unit = "" if row.unit == "1" else f" {row.unit}"
            found.setdefault(row.fault, []).append(f"{row.size} {size:.3g}{unit}")
    return tuple((fault, " or ".join(sizes)) for fault, sizes in found.items())


def tested_alone(fault: Fault, sensors: SensorSymptoms) -> bool:
    """Whether a test of the sensor alone detects this mode of its faults."""
    steps = fault.channel in sensors.positions and fault.mode in JUMP_MODES
    return steps or any(fault.mode in modes for modes in OWN_TESTS.values())


def _is_detectable(model: FaultModel, reach: Mapping[str, float]) -> bool:
    """Whether the fault at its largest passes the limit of a residual of this stand."""
    terms = [term for term in model.terms if term.residual in reach]
    if any(term.regressor != CONSTANT for term in terms):
        return True
    offsets: dict[str, float] = {}
    for term in terms:
        size = model.sizes[term.index]
        largest = abs(term.gain) * max(abs(size.low), abs(size.high))
        offsets[term.residual] = offsets.get(term.residual, 0.0) + largest
    return any(offset > reach[name] for name, offset in offsets.items())
