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

"""Reader of a calibration in its mapping form: what holds between entries, beyond each field."""

from __future__ import annotations

import re
from collections.abc import Collection, Iterator, Mapping
from dataclasses import asdict, fields
from typing import Any

from flea_diag.core.calibration.calibration import (
    LATER_PARAMETERS,
    SINCE_OUT_OF_SAMPLE,
    Calibration,
    CovarianceBlock,
)
from flea_diag.core.detection.coefficient_shift import COEFFICIENT_WINDOWS_S
from flea_diag.core.detection.mean_shift import SHIFT_WINDOWS_S
from flea_diag.core.detection.window_limit import SPEED_REGIONS_M_S, ResidualLimit
from flea_diag.core.observers.observer_noise import PROCESS, ObserverNoise
from flea_diag.core.residuals.leverage import CalibrationEnvelope
from flea_diag.core.residuals.parameters import (
    LATER_TOLERANCES,
    STANDARD,
    UNIT_PARAMETERS,
    ActuatorParameters,
    UnitTolerance,
    actuator_parameters,
)
from flea_diag.core.residuals.residual_rows import WINDOWS_S
from flea_diag.core.scan_counts import ScanCounts
from flea_diag.errors import CalibrationError, shown
from flea_diag.fields.reader import read_as
from flea_diag.fields.values import LIMITED, Positive
from flea_diag.formats import migrated

REGIONS = "speed_regions_m_s"
LATER = (
    "observer_noise", "sensors", "covariance", "shifts", "actuator_sha256", "counted_period_s",
    "smoothing_s",
    *SINCE_OUT_OF_SAMPLE,
)  # fmt: skip
"""Optional entries of this schema."""
NAMES = tuple(entry.name for entry in fields(Calibration))
FURTHER = "further_parameters"
"""Entry of the parameters that only some description names."""
RETIRED = {"tolerance": ("noise_log",)}
"""Entry -> keys that older files have in it; rows of lists may have others, which are not used."""


def from_mapping(content: object, where: str) -> Calibration:
    """Calibration from its plain mapping.

    Raises
    ------
    CalibrationError
        An entry is missing, unknown, of the wrong type or not finite; ``where`` is named.
    """
    mapping = migrated("calibration", content, where)
    if mapping.get(REGIONS) != list(SPEED_REGIONS_M_S):
        raise CalibrationError(
            f"{where}: {REGIONS} = {shown(mapping.get(REGIONS))}, this version tests in "
            f"{list(SPEED_REGIONS_M_S)!r}; repeat 'flea calibrate'"
        )
    known = {key: value for key, value in mapping.items() if key != REGIONS}
    _require(known, where)
    levels = known.pop("observer_noise", None)
    noise = (
        ObserverNoise() if levels is None else _observer_noise(levels, f"{where}: observer_noise")
    )
    given: dict[str, Any] = {"observer_noise": noise}
    further = known.pop(FURTHER, None)
    if further is not None:
        given["parameters"] = _parameters(known.pop("parameters"), further, where)
    made = read_as(
        Calibration, known, where, error=CalibrationError, magnitudes=LIMITED, strict=False,
        given=given,
    )  # fmt: skip
    for wrong in _contradictions(made):
        raise CalibrationError(f"{where}: {wrong}")
    return made


def _require(known: Mapping[str, Any], where: str) -> None:
    """A calibration states what else would have a default, which is that of no actuator."""
    for name, value in known.items():
        if value is None:
            raise CalibrationError(f"{where}: {name} = None holds nothing; leave it out")
    _complete(known, (*NAMES, FURTHER), where, (*LATER, FURTHER))
    for key, kind, later in (
        ("parameters", ActuatorParameters, LATER_PARAMETERS),
        ("tolerance", UnitTolerance, LATER_TOLERANCES),
    ):
        names = tuple(entry.name for entry in fields(kind))
        _complete(known[key], names, f"{where}: {key}", later, RETIRED.get(key, ()))


def _complete(
    content: Any,
    names: Collection[str],
    where: str,
    later: Collection[str] = (),
    retired: Collection[str] = (),
) -> None:
    """All names are there but those that an older file may lack, and no others."""
    if not isinstance(content, Mapping):
        return  # the reader refuses it
    for key in content:
        if key not in names and key not in retired:
            raise CalibrationError(
                f"{where}: unknown key {shown(key)}, known are {', '.join(names)}"
            )
    for name in names:
        if name not in content and name not in later:
            raise CalibrationError(f"{where}: {name} is missing; repeat 'flea calibrate'")


def _parameters(content: Any, further: Any, where: str) -> ActuatorParameters:
    """Those of every calibration, with those that only this description names."""
    standard = read_as(
        ActuatorParameters, content, f"{where}: parameters", error=CalibrationError,
        magnitudes=LIMITED, strict=False,
    )  # fmt: skip
    own = read_as(dict[str, float], further, f"{where}: {FURTHER}", error=CalibrationError)
    for name in own:
        if name in STANDARD or not name.isidentifier():
            raise CalibrationError(f"{where}: {FURTHER}: {shown(name)} is no name of a further one")
    return actuator_parameters({**asdict(standard), **own})


def _observer_noise(content: Any, where: str) -> ObserverNoise:
    levels = read_as(
        dict[str, Positive], content, where, error=CalibrationError, magnitudes=LIMITED
    )
    _complete(levels, (*PROCESS, *levels), where)
    return ObserverNoise.of(levels)


# --- what holds between entries -----------------------------------------------------------


def _contradictions(made: Calibration) -> Iterator[str]:
    digest = made.actuator_sha256
    if digest and not re.fullmatch("[0-9a-f]{64}", digest):
        yield f"actuator_sha256 = {shown(digest)} is no SHA-256 of 64 hexadecimal digits"
    if not made.channels:
        yield "channels is empty: nothing was calibrated"
    for wrong in _of_envelope(made.envelope) if made.envelope else ():
        yield f"envelope: {wrong}"
    for limit in made.limits:
        for wrong in _of_limit(limit, made.counts):
            yield f"limits: {shown(limit.name)}: {wrong}"
    for shift in made.shifts:
        windows_s = COEFFICIENT_WINDOWS_S if shift.along else SHIFT_WINDOWS_S
        shifts = tuple(map(made.counts.of, windows_s))
        if shift.window not in shifts:
            yield f"shifts: {shown(shift.name)}: window = {shift.window}, choose one of {shifts}"
    for block in made.covariance:
        for wrong in _of_covariance(block, made.parameters):
            yield f"covariance: {wrong}"
    for name in made.units.spread if made.units else ():
        if name not in UNIT_PARAMETERS:
            yield f"units: {shown(name)} is no parameter that units differ in"
    for wrong in made.law.contradictions() if made.law else ():
        yield f"law: {wrong}"
    nats = made.coverage.nats if made.coverage else ()
    if list(nats) != sorted(nats):
        yield "coverage: nats must ascend"


def _of_envelope(envelope: CalibrationEnvelope) -> Iterator[str]:
    for name, (low, high) in envelope.ranges.items():
        if not low <= high:
            yield f"ranges: {shown(name)} from {low!r} to {high!r} holds nothing"
    for fit in envelope.relations:
        if any(len(row) != len(fit.root) for row in fit.root):
            yield f"relations: {shown(fit.relation)}: root is not square"


def _of_limit(limit: ResidualLimit, counts: ScanCounts) -> Iterator[str]:
    windows = [each.window for each in limit.windows]
    known = tuple(map(counts.of, WINDOWS_S))
    if not windows or len({*windows} & {*known}) != len(windows):
        yield f"windows {shown(windows)}, known {known}, each once"
    rows = {"sigma": limit.sigma}
    for each in limit.windows:
        rows |= {f"window {each.window}: centre": each.centre}
        rows |= {f"window {each.window}: sigma": each.sigma}
    for name, row in rows.items():
        if len(row) != len(SPEED_REGIONS_M_S) + 1:
            yield f"{name} needs {len(SPEED_REGIONS_M_S) + 1} speed regions, has {len(row)}"
    every = len(UNIT_PARAMETERS)
    if len(limit.spread) not in (0, *range(every - len(LATER_TOLERANCES), every + 1)):
        yield f"spread has {len(limit.spread)} numbers, not {every}"


def _of_covariance(block: CovarianceBlock, parameters: ActuatorParameters) -> Iterator[str]:
    known = asdict(parameters)
    for name in block.parameters:
        if name not in known:
            yield f"{shown(name)} is no parameter"
    if [len(row) for row in block.matrix] != [len(block.parameters)] * len(block.parameters):
        yield f"{block.parameters[0] if block.parameters else 'a block'}: matrix is not square"
        return
    for place, name in enumerate(block.parameters):
        if block.matrix[place][place] < 0.0:
            yield f"{name}: variance {block.matrix[place][place]!r} is below 0"
