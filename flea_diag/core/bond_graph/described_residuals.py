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

"""The residuals that a description names: read, and checked against its graph and sensors."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from flea_diag.core.bond_graph.actuator_model import (
    Actuator,
    ResidualSpec,
)
from flea_diag.core.symbolic.unit import SECOND, dimension, times
from flea_diag.errors import ConfigurationError, shown
from flea_diag.fields.reader import read_as


def described_residuals(rows: Mapping[str, Any], where: str) -> dict[str, ResidualSpec]:
    """Name -> residual, in the order of the description.

    Raises
    ------
    ConfigurationError
        Unknown key or kind, or a value of the wrong type.
    """
    return {
        name: read_as(ResidualSpec, row, f"{where}: residual {shown(name)}", given={"name": name})
        for name, row in rows.items()
    }


def check_residual(made: Actuator, spec: ResidualSpec, where: str) -> None:
    """Refuse a residual of what the actuator does not have.

    Raises
    ------
    ConfigurationError
        Names the residual, and the channel, junction, parameter or unit that is wrong.
    """
    place = f"{where}: residual {shown(spec.name)}"
    if spec.kind == "measurement" or spec.model:
        made.view(spec.model)
    if spec.kind == "prediction":
        _check_prediction(made, spec, place)
    if spec.balances:
        for name in (spec.junction,) if spec.kind == "junction" else spec.junctions or ("",):
            junction = made.graph.elements.get(name)
            if junction is None or junction.kind not in ("0", "1"):
                raise ConfigurationError(f"{place}: {shown(name)} is no junction")
        if spec.motion and spec.motion not in made.graph.elements:
            raise ConfigurationError(
                f"{place}: motion {shown(spec.motion)} is no junction of the graph"
            )
        if spec.divided_by and spec.divided_by not in made.graph.parameters:
            raise ConfigurationError(
                f"{place}: divided_by {shown(spec.divided_by)} is no parameter"
            )
        return
    if spec.kind == "difference" and not (spec.reference or spec.offset):
        raise ConfigurationError(
            f"{place}: {spec.channel} is held against nothing; name a reference, or as its offset "
            "the parameter that it reads while healthy"
        )
    if spec.supplied_by and (spec.supplied_by not in made.supplies or not spec.reference):
        raise ConfigurationError(
            f"{place}: supplied_by {shown(spec.supplied_by)} is no supply, known are "
            f"{', '.join(made.supplies) or 'none'}; it belongs to a difference with a reference"
        )
    for channel in (spec.channel, *((spec.reference,) if spec.reference else ())):
        if channel not in made.units:
            raise ConfigurationError(f"{place}: {shown(channel)} is no channel or input")
    between = made.graph.elements.get(spec.across)
    if spec.across and (between is None or between.kind not in ("C", "R")):
        raise ConfigurationError(
            f"{place}: across {shown(spec.across)} is no element of type C or R"
        )
    _check_unit_of_difference(made, spec, place)


def _check_prediction(made: Actuator, spec: ResidualSpec, place: str) -> None:
    sensor = made.sensors.get(spec.channel)
    for name in spec.neglected:
        if name not in made.graph.parameters:
            raise ConfigurationError(f"{place}: neglected {shown(name)} is no parameter")
    for name in spec.lumped:
        element = made.graph.elements.get(name)
        if element is None or element.kind not in ("C", "I"):
            raise ConfigurationError(f"{place}: lumped {shown(name)} is no store (C or I)")
    ends = {bond.other(name) for name in spec.lumped for bond in made.graph.at(name)}
    if spec.lumped and (sensor is None or sensor.at not in ends):
        raise ConfigurationError(
            f"{place}: lumps {', '.join(spec.lumped)}, none of them is where {spec.channel} is read"
        )


def _check_unit_of_difference(made: Actuator, spec: ResidualSpec, place: str) -> None:
    """Both channels are in the unit of the residual; a displacement is, or its rate."""
    wanted = dimension(spec.unit)
    sensor, other = (made.sensors.get(name) for name in (spec.channel, spec.reference))
    if sensor and other and other.integrates and not sensor.integrates:
        channels, wanted = [spec.reference], times(wanted, SECOND)
    else:
        channels = [name for name in (spec.channel, spec.reference) if name]
    for channel in channels:
        if dimension(made.units[channel]) != wanted:
            raise ConfigurationError(
                f"{place} has unit {shown(spec.unit)}, but {channel} is in "
                f"{shown(made.units[channel])}"
            )
    for role in (spec.gain, spec.offset):
        if role and role not in made.graph.parameters:
            raise ConfigurationError(f"{place}: {shown(role)} is no parameter")
