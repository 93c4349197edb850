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

"""What a stage knows of a stand: relations, faults, signatures, features."""

from __future__ import annotations

from functools import cache
from pathlib import Path

from flea_diag.configuration.calibrations import calibration_sha256, require_description
from flea_diag.configuration.description import (
    compiled_relations,
    effects_of,
    require_relations,
    signatures,
)
from flea_diag.configuration.files import load_yaml
from flea_diag.configuration.stand import Stand
from flea_diag.core.calibration.calibration import Calibration
from flea_diag.core.choice.feature_table import FaultFeatureTable
from flea_diag.core.likelihood.effect_set import EffectSet
from flea_diag.core.observers.observer_noise import reading_key
from flea_diag.core.residuals.channel_units import UNITS
from flea_diag.core.residuals.relation_set import RelationSet
from flea_diag.errors import ConfigurationError, shown
from flea_diag.stages.isolator.isolator import Knowledge


@cache
def load_features(name_or_path: str | Path) -> FaultFeatureTable:
    """Fault feature table from a file."""
    return FaultFeatureTable.from_mapping(load_yaml(name_or_path), str(name_or_path))


def knowledge(stand: Stand, calibration: Calibration) -> Knowledge:
    """Knowledge of the isolator: fault catalogue and signatures for the sensors of this stand.

    Raises
    ------
    CalibrationError
        The calibration was made with another description than the stand's.
    """
    require_description(calibration, stand)
    rows, tables = signatures(
        stand.actuator, stand.faults, calibration.channels, calibration.period_s
    )
    table = load_features(stand.features).of_vibration()
    known = effects(stand, calibration)
    return Knowledge(calibration, calibration_sha256(calibration), known, rows, tables, table)


def effects(stand: Stand, calibration: Calibration) -> EffectSet:
    """Effects of the catalogue on the relations that run, for the sensors of a calibration."""
    known = relations(stand, calibration)
    return effects_of(stand.actuator, stand.faults, known, calibration.channels)


def relations(stand: Stand, calibration: Calibration) -> RelationSet:
    """The relations that run, for the sensors and parameters of a calibration.

    Raises
    ------
    ConfigurationError
        No sensors close a relation, or the calibration has identified a parameter that none holds.
    """
    require_relations(stand.actuator)
    has_encoder = calibration.parameters.encoder_m_per_rad != 0.0
    drawn = compiled_relations(stand.actuator).parameters
    for name in calibration.sigmas:
        if name not in drawn:
            raise ConfigurationError(
                f"{stand.actuator}: no relation holds {name}, which the calibration has "
                "identified; draw it and name it under base_parameters, as "
                "config/stands/flea/actuator.yaml does"
            )
    known = compiled_relations(stand.actuator, calibration.channels, has_encoder)
    limits = (*calibration.limits, *calibration.shifts)
    for name in dict.fromkeys(limit.name for limit in limits):
        if name not in known.residuals.place:
            raise ConfigurationError(
                f"{stand.actuator}: the calibration holds limits of {shown(name)}, which is no "
                "residual of this description; repeat 'flea calibrate'"
            )
    terms = known.reading_terms(calibration.parameters)
    read = {(term.residual, term.channel) for term in terms}
    for shift in calibration.shifts:
        if shift.along and (shift.name, shift.along) not in read:
            raise ConfigurationError(
                f"{stand.actuator}: the calibration holds limits of {shown(shift.name)} along "
                f"{shown(shift.along)}, which it does not read; repeat 'flea calibrate'"
            )
    _require_sensors(stand, calibration, known)
    return known


def _require_sensors(stand: Stand, calibration: Calibration, known: RelationSet) -> None:
    """Refuse limits and noise of channels that the description does not have.

    Noise of a standard channel is in files of stands that lack it.
    """
    sensors = known.residuals.sensors
    tested = (*sensors.resolutions, *sensors.held)
    for limit in calibration.sensors:
        if limit.channel not in tested:
            raise ConfigurationError(
                f"{stand.calibration}: sensors: {shown(limit.channel)} is no sensor of "
                f"{stand.actuator} that is tested by itself, known are {', '.join(tested)}"
            )
    units = {**UNITS, **known.residuals.units}
    keys = [reading_key(name, unit) for name, unit in units.items()]
    for key, _ in calibration.observer_noise.readings:
        if key not in keys:
            raise ConfigurationError(
                f"{stand.calibration}: observer_noise: {shown(key)} is of no channel of "
                f"{stand.actuator}, known are {', '.join(keys)}"
            )
