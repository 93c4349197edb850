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

"""The rows of ``channels.yaml`` as it is written."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Annotated

from flea_diag.fields.values import AboveZero, one_of, within
from flea_diag.wire.sources.mapping import FORMATS, RESAMPLINGS


@dataclass(frozen=True)
class SourcePlace:
    """Where a reading is: a column of a table, or a field of a topic's messages."""

    topic: str = ""
    type: str = ""
    field: str = ""
    column: str = ""


@dataclass(frozen=True)
class PlaceTerm(SourcePlace):
    """One summand of a channel."""

    sign: int = 1


@dataclass(frozen=True, kw_only=True)
class ChannelRow(PlaceTerm):
    """One channel. Limits are in SI whatever the unit of the readings: a wrong unit shows."""

    unit: str
    range: tuple[float, float]
    sum: tuple[PlaceTerm, ...] = ()
    scale: AboveZero = 1.0
    offset: float = 0.0
    rate_hz: Annotated[float, within(maximum=1e6, above=0.0)] = math.nan
    resample: Annotated[str, one_of(*RESAMPLINGS)] = RESAMPLINGS[0]
    age_s: float = math.nan
    turn: Annotated[float, within(0.0, 1e9)] = 0.0
    serial: str = ""
    mount: str = ""
    sampling: str = "mean"
    note: str = ""


@dataclass(frozen=True, kw_only=True)
class AccelerometerRow:
    """One accelerometer: the column or field of each axis; limits in m/s^2."""

    axes: Mapping[str, str]
    topic: str = ""
    type: str = ""
    unit: str
    range: tuple[float, float]
    rate_hz: Annotated[float, within(1.0, 1e6)]
    serial: str = ""
    mount: str = ""


@dataclass(frozen=True)
class TimeColumn:
    """Column of the times of a table, and the moment that they count from."""

    column: str
    unit: str = "s"
    start: str = ""


@dataclass(frozen=True)
class ChannelsFile:
    """The whole file."""

    format: Annotated[str, one_of(*FORMATS)] = FORMATS[0]
    rate_hz: float = math.nan
    channels: Mapping[str, ChannelRow] = field(default_factory=dict)
    accelerometers: Mapping[str, AccelerometerRow] = field(default_factory=dict)
    time: TimeColumn | None = None
    split_by: tuple[str, ...] = ()
    truth: Mapping[str, str] = field(default_factory=dict)
