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

"""The result of calibration: parameters, uncertainties and limits from nominal recordings.

``calibrate`` is the whole procedure: identify the parameters (``identification``), then learn
the limits from the residuals of the same recordings (``thresholds``). A calibration file
contains the mapping form; it names the recordings used.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import asdict, dataclass, field, fields
from typing import Annotated, Any

import numpy as np
import numpy.typing as npt

from flea_diag.core.calibration.out_of_sample import GroupCoverage, LeftOut, OutOfSample
from flea_diag.core.calibration.promise import FalseAlarmPromise
from flea_diag.core.detection.mean_shift import MeanShiftLimit
from flea_diag.core.detection.window_limit import SPEED_REGIONS_M_S, ResidualLimit
from flea_diag.core.frozen import Frozen
from flea_diag.core.observers.observer_noise import ObserverNoise
from flea_diag.core.residuals.leverage import CalibrationEnvelope
from flea_diag.core.residuals.parameters import (
    LATER_TOLERANCES,
    UNIT_PARAMETERS,
    ActuatorParameters,
    UnitSpread,
    UnitTolerance,
    further_of,
)
from flea_diag.core.residuals.unit_difference import difference_sigmas
from flea_diag.core.run_law.run_law import RunLaw
from flea_diag.core.scan_counts import COUNTED_PERIOD_S, SMOOTHING_S, SMOOTHINGS_S, ScanCounts
from flea_diag.core.sensors.sensor_limits import SensorLimit
from flea_diag.fields.values import NotNegative, Positive, within
from flea_diag.formats import stamped

Array = npt.NDArray[np.float64]

PERIOD_S = (1e-4, 1.0)
"""Times between scans that a calibration may have."""

LATER_PARAMETERS = (
    "supply_voltage_v",
    "coupling_compliance_m_per_n",
    "coupling_play_m",
    "position_gain",
    "drive_drop_v",
)
"""Parameters that only some actuators have; neutral where a file lacks them."""
NEUTRAL = ActuatorParameters()
SINCE_OUT_OF_SAMPLE = ("out_of_sample", "left_out", "envelope", "coverage", "units", "law")
"""Entries that older files lack; without them a calibration is the same as such a file."""


@dataclass(frozen=True)
class NominalRun:
    """One nominal recording: rows of ``ResidualSet.channels``, shape (scans, channels)."""

    name: str
    rows: Array


@dataclass(frozen=True, slots=True)
class BadStretch:
    """Interval of a recording in which a channel was unreliable; it is excluded."""

    run: str
    channel: str
    start_s: float
    end_s: float


@dataclass(frozen=True, slots=True)
class CovarianceBlock:
    """Covariance of parameters that were fitted together, ``matrix`` in their order.

    Blocks come from different relations and are assumed independent of each other.
    """

    parameters: tuple[str, ...]
    matrix: tuple[tuple[float, ...], ...]


@dataclass(frozen=True)
class Calibration(Frozen):
    """Everything the diagnoser knows about an actuator beyond its structure.

    ``sigmas`` holds the standard error of each identified parameter. A parameter that cannot be
    identified from the recordings is in ``not_identified`` with the reason and keeps its default.
    """

    actuator: str
    period_s: Annotated[float, within(*PERIOD_S)]
    channels: tuple[str, ...]
    voltage_sampling: str
    parameters: ActuatorParameters
    sigmas: Mapping[str, NotNegative]
    not_identified: Mapping[str, str]
    tolerance: UnitTolerance
    limits: tuple[ResidualLimit, ...]
    false_alarms_per_hour: Positive
    voltage_limit_v: Positive
    nominal_s: Positive
    sources: tuple[str, ...]
    bad_stretches: tuple[BadStretch, ...] = ()
    observer_noise: ObserverNoise = field(default_factory=ObserverNoise)
    sensors: tuple[SensorLimit, ...] = ()
    covariance: tuple[CovarianceBlock, ...] = ()
    shifts: tuple[MeanShiftLimit, ...] = ()
    actuator_sha256: str = ""
    """Digest of the description that it was made with; empty in an older file."""
    out_of_sample: OutOfSample | None = None
    left_out: tuple[LeftOut, ...] = ()
    envelope: CalibrationEnvelope | None = None
    """Where it was made; None in an older file: then no test depends on where the motion is."""
    coverage: GroupCoverage | None = None
    """Scores of faulty runs, by which a group holds the fault as often as stated."""
    units: UnitSpread | None = None
    """What the units of the calibration differ by; None where fewer than three are known."""
    counted_period_s: Annotated[float, within(*PERIOD_S)] = COUNTED_PERIOD_S
    """Period by which times were made counts of scans; an older file has the FLEA's at any rate."""
    smoothing_s: Annotated[float, within(*SMOOTHINGS_S)] = SMOOTHING_S
    """Time over which readings were smoothed, by the description."""
    law: RunLaw | None = None
    """What healthy recordings differ by, and what it can see; None in an older file."""

    def tolerances(self) -> tuple[float, ...]:
        """Spread of healthy units in the order of ``UNIT_PARAMETERS``."""
        return tuple(getattr(self.tolerance, name) for name in UNIT_PARAMETERS)

    def differences(self, names: Collection[str]) -> tuple[float, ...]:
        """The same including the heating rates, in the order of ``unit_differences``."""
        return difference_sigmas(self.tolerance, names)

    @property
    def counts(self) -> ScanCounts:
        """Counts of scans that its limits hold for."""
        return ScanCounts(self.counted_period_s, self.smoothing_s)

    @property
    def mean_shifts(self) -> tuple[MeanShiftLimit, ...]:
        """Limits of shifts of means, without those of coefficients."""
        return tuple(limit for limit in self.shifts if not limit.along)

    @property
    def promise(self) -> FalseAlarmPromise:
        """Stated rate of false alarms, and what the recordings support."""
        hours = self.nominal_s / 3600.0
        alarms = self.out_of_sample.alarms if self.out_of_sample else 0
        return FalseAlarmPromise(self.false_alarms_per_hour, len(self.sources), hours, alarms)

    def limit(self, residual: str) -> ResidualLimit | None:
        """Limits of one residual, None if this stand cannot form it."""
        return next((entry for entry in self.limits if entry.name == residual), None)

    @property
    def variances(self) -> dict[str, float]:
        """Residual -> variance of a scan, in times of the scans that make an independent one."""
        return {row.name: row.sigma[0] ** 2 * row.correlation_samples for row in self.limits}

    def to_mapping(self) -> dict[str, Any]:
        """Plain mapping of numbers, strings and lists, as in a YAML file."""
        plain = {name: _plain(getattr(self, name)) for name in (f.name for f in fields(self))}
        plain["observer_noise"] = self.observer_noise.to_mapping()
        plain["law"] = None if self.law is None else self.law.to_mapping()
        plain["shifts"] = [limit.to_mapping() for limit in self.shifts]
        further = further_of(self.parameters)
        for name in further:
            plain["parameters"].pop(name)
        for name in LATER_PARAMETERS:
            if plain["parameters"][name] == getattr(NEUTRAL, name):
                plain["parameters"].pop(name)  # so that a calibration without it keeps its digest
        for name in LATER_TOLERANCES:
            if not plain["tolerance"][name]:
                plain["tolerance"].pop(name)
        # Without what an older file lacks it is the same as that file.
        plain = {k: v for k, v in plain.items() if v or k not in SINCE_OUT_OF_SAMPLE}
        if plain.get("envelope") and not plain["envelope"]["travel"]:
            plain["envelope"].pop("travel")
        if self.counted_period_s == COUNTED_PERIOD_S:
            plain.pop("counted_period_s")
        if self.smoothing_s == SMOOTHING_S:
            plain.pop("smoothing_s")
        if further:
            plain["further_parameters"] = further
        return stamped("calibration", {**plain, "speed_regions_m_s": list(SPEED_REGIONS_M_S)})


def _plain(value: Any) -> Any:
    if hasattr(value, "__dataclass_fields__"):
        return {key: _plain(entry) for key, entry in asdict(value).items()}
    if isinstance(value, Mapping):
        return {str(key): _plain(entry) for key, entry in value.items()}
    if isinstance(value, (tuple, list)):
        return [_plain(entry) for entry in value]
    if isinstance(value, np.generic):
        return value.item()
    return value
