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

"""Rows of the catalogue that say how large a fault is, and which parameters it moves by how much.

A size moves base parameters of the description (``moves``), scales physical ones in fixed
proportions (``scales``), opens an element (``opens``: no flow passes it), or adds a drag that is no
change of a parameter (``adds``). Sizes of sensor errors belong to the channel.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass, field
from typing import Annotated, Any

from flea_diag.core.bond_graph.actuator_model import Actuator
from flea_diag.core.symbolic.collect import monomial
from flea_diag.core.symbolic.expression import Expression
from flea_diag.errors import ConfigurationError, shown
from flea_diag.fields.reader import read_as
from flea_diag.fields.values import Share, within

Amounts = tuple[tuple[str, float], ...]


@dataclass(frozen=True)
class SizeBounds:
    """What a size is, and between which values, before the numbers of a calibration.

    ``low`` and ``high`` bound it, in multiples of the base parameter ``of`` if there is one;
    ``least`` takes the place of ``low`` where the fault has shown itself in vibration alone.
    At ``limit``, in the same multiples, the part is at its end of life; infinite: none is stated.
    """

    name: str
    unit: str
    low: float
    high: float
    least: float
    of: str = ""
    limit: float = math.inf


@dataclass(frozen=True)
class SizeRow:
    """One size of a fault, and what one unit of it does."""

    bounds: SizeBounds
    moves: Amounts
    scales: Amounts
    opens: tuple[str, ...]
    adds: tuple[tuple[str, Expression], ...]


@dataclass(frozen=True)
class EffectRow:
    """Sizes of one alternative, in order, and how much their effect scatters along the stroke.

    ``roughness`` lists shares of the effect, one model each; ``vibration_only`` rows stand beside
    the others where only vibration deviates.
    """

    sizes: tuple[SizeRow, ...]
    roughness: tuple[float, ...]
    vibration_only: bool


@dataclass(frozen=True)
class ErrorRow:
    """Largest errors of one channel: bias in its unit, drift per second; unbounded by default.

    ``drift_as_speed`` holds where its slope is the only speed, and takes the drift for one. A
    scaled reading is between ``factors`` of the truth, a dead one lacks a share of it between those
    of ``lost``; a drift has one of ``ages_s`` when it is detected.
    """

    bias: float = math.inf
    drift: float = math.inf
    drift_as_speed: float = math.inf
    factors: tuple[float, float] = (0.6, 1.6)
    lost: tuple[float, float] = (0.9, 1.1)
    ages_s: tuple[float, ...] = (0.3, 1.0, 2.0, 4.0, 8.0, 15.0)


UNBOUNDED = ErrorRow()


@dataclass(frozen=True)
class _Size:
    """A size as the catalogue describes it."""

    name: str
    unit: str
    low: float = 0.0
    high: float = math.inf
    least: float | None = None
    of: str = ""
    limit: float = math.inf
    moves: Mapping[str, float] = field(default_factory=dict)
    scales: Mapping[str, float] = field(default_factory=dict)
    opens: tuple[str, ...] = ()
    adds: Mapping[str, str] = field(default_factory=dict)


@dataclass(frozen=True)
class _Effect:
    """An effect as the catalogue describes it."""

    sizes: tuple[_Size, ...]
    roughness: tuple[Share, ...] = (0.0,)
    vibration_only: bool = False


@dataclass(frozen=True)
class _Errors:
    """Largest errors of a channel as the catalogue describes them."""

    bias: float = math.inf
    drift: float = math.inf
    drift_as_speed: float = math.inf
    ages_s: tuple[Annotated[float, within(maximum=1e4, above=0.0)], ...] = UNBOUNDED.ages_s


def effect_rows(content: Any, actuator: Actuator, where: str) -> tuple[EffectRow, ...]:
    """Rows under ``effects`` of one fault; none where no calibration could hold a parameter.

    Raises
    ------
    ConfigurationError
        A row names no parameter or residual of the description, or moves nothing.
    """
    known = content if actuator.base_parameters else ()
    return tuple(
        _effect(row, actuator, f"{where}: effect {number}")
        for number, row in enumerate(known, start=1)
    )


def error_rows(
    content: Mapping[str, Any], actuator: Actuator, where: str
) -> Mapping[str, ErrorRow]:
    """Channel -> largest errors, of the channels that are named."""
    found = {}
    for channel, row in content.items():
        if channel not in actuator.sensors and actuator.base_parameters:
            raise ConfigurationError(
                f"{where}: {shown(channel)} is no sensor of {actuator.name}, known are "
                f"{', '.join(actuator.sensors)}"
            )
        errors = read_as(_Errors, row, f"{where}: {channel}")
        if not errors.ages_s:
            raise ConfigurationError(f"{where}: {channel}: ages_s is empty; name at least one")
        found[channel] = ErrorRow(**vars(errors))
    return found


def _effect(content: Any, actuator: Actuator, where: str) -> EffectRow:
    row = read_as(_Effect, content, where)
    for key in ("sizes", "roughness"):
        if not getattr(row, key):
            raise ConfigurationError(f"{where}: {key} is empty; name at least one")
    sizes = tuple(_size(size, actuator, f"{where}: size {shown(size.name)}") for size in row.sizes)
    return EffectRow(sizes, row.roughness, row.vibration_only)


def _size(row: _Size, actuator: Actuator, where: str) -> SizeRow:
    base, physical = actuator.base_parameters, actuator.graph.parameters
    for names, known, kind, key in (
        ((row.of,) if row.of else (), base, "base parameter", "of"),
        (row.moves, base, "base parameter", "moves"),
        (row.scales, physical, "parameter", "scales"),
        (row.opens, physical, "parameter", "opens"),
        (row.adds, actuator.residuals, "residual", "adds"),
    ):
        _require(names, known, kind, f"{where}: {key}")
    if not (row.moves or row.scales or row.opens or row.adds):
        raise ConfigurationError(
            f"{where} moves nothing; give moves, scales, opens or adds with what it changes"
        )
    if not row.low <= row.high:
        raise ConfigurationError(f"{where}: low = {row.low} must be at most high = {row.high}")
    if not row.limit > max(row.low, 0.0):
        raise ConfigurationError(
            f"{where}: limit = {row.limit}, the size at the end of life, must be above "
            f"{max(row.low, 0.0)}"
        )
    least = row.low if row.least is None else row.least
    bounds = SizeBounds(row.name, row.unit, row.low, row.high, least, row.of, row.limit)
    adds = tuple((name, monomial(text)) for name, text in row.adds.items())
    return SizeRow(bounds, tuple(row.moves.items()), tuple(row.scales.items()), row.opens, adds)


def _require(names: Iterable[str], known: Collection[str], kind: str, where: str) -> None:
    for name in names:
        if name not in known:
            raise ConfigurationError(
                f"{where}: {shown(name)} is no {kind} of the description, known are"
                f" {', '.join(known)}"
            )
