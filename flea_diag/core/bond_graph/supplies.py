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

"""Supplies of a machine that a channel reads: the band in which each is healthy."""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping
from dataclasses import dataclass
from typing import Any

from flea_diag.errors import ConfigurationError, shown
from flea_diag.fields.reader import read_as


@dataclass(frozen=True)
class Supply:
    """Healthy while ``channel`` reads from ``low`` to ``high``, in its unit.

    ``residual`` holds it against its level: it is 0 within the band, whatever the level.
    """

    name: str
    channel: str
    low: float = math.nan
    high: float = math.nan
    residual: str = ""


def supplies(
    rows: Mapping[str, Any],
    sensors: Collection[str],
    held: Mapping[str, tuple[str, str]],
    values: Mapping[str, float],
    where: str,
) -> dict[str, Supply]:
    """Name -> supply, in the order of the description.

    ``held``: channel -> residual that holds it against a parameter alone, and that parameter, of
    which ``values`` are the values.

    Raises
    ------
    ConfigurationError
        Names the supply, and the channel, band or residual that is wrong or missing.
    """
    found = {}
    for name, row in rows.items():
        place = f"{where}: supply {shown(name)}"
        told = read_as(Supply, row, place, given={"name": name, "residual": ""})
        if told.channel not in sensors:
            raise ConfigurationError(
                f"{place}: {shown(told.channel)} is no sensor, known are {', '.join(sensors)}"
            )
        if told.channel not in held:
            raise ConfigurationError(
                f"{place}: no residual holds {told.channel} against its level; add one of kind "
                "difference with this channel, and the parameter of its level as the offset"
            )
        residual, level = held[told.channel]
        if level not in values:
            raise ConfigurationError(
                f"{place}: residual {shown(residual)} has offset {shown(level)}, which is no "
                "parameter; name that of the level"
            )
        _check_band(told, values[level], level, place)
        found[name] = Supply(name, told.channel, told.low, told.high, residual)
    return found


def _check_band(told: Supply, level: float, parameter: str, place: str) -> None:
    if math.isnan(told.low) or math.isnan(told.high):
        raise ConfigurationError(
            f"{place}: {told.channel} has no band; say between which readings the supply is "
            f"healthy, as low: {0.9 * level:.4g} and high: {1.1 * level:.4g}"
        )
    if not told.low < told.high:
        raise ConfigurationError(
            f"{place}: low = {told.low:g} must be less than high = {told.high:g}"
        )
    if not told.low <= level <= told.high:
        raise ConfigurationError(
            f"{place}: {parameter} = {level:g} is not in its band of {told.low:g} to "
            f"{told.high:g}; correct one of the two"
        )
