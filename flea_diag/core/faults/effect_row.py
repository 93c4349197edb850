"""Rows of the catalogue that say how large a fault is, and which parameters it moves by how much.

A size moves base parameters of the description (``moves``), scales physical ones in fixed
proportions (``scales``), opens an element (``opens``: no flow passes it), or adds a drag that is no
change of a parameter (``adds``). Sizes of sensor errors belong to the channel.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping
from dataclasses import dataclass
from typing import Any

from flea_diag.core import schema
from flea_diag.core.bond_graph.actuator_model import Actuator
from flea_diag.core.schema import REQUIRED
from flea_diag.core.symbolic.collect import monomial
from flea_diag.core.symbolic.expression import Expression
from flea_diag.errors import ConfigurationError, shown

Amounts = tuple[tuple[str, float], ...]


@dataclass(frozen=True)
class SizeBounds:
    """What a size is, and between which values, before the numbers of a calibration.

    ``low`` and ``high`` bound it, in multiples of the base parameter ``of`` if there is one;
    ``least`` takes the place of ``low`` where the fault has shown itself in vibration alone.
    """

    name: str
    unit: str
    low: float
    high: float
    least: float
    of: str = ""


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
_EFFECT: schema.Keys = {
    "sizes": (list, REQUIRED),
    "roughness": (list, [0.0]),
    "vibration_only": (bool, False),
}
_SIZE: schema.Keys = {
    "name": (str, REQUIRED),
    "unit": (str, REQUIRED),
    "low": (float, 0.0),
    "high": (float, math.inf),
    "least": (float, None),
    "of": (str, ""),
    "moves": (dict, {}),
    "scales": (dict, {}),
    "opens": (list, []),
    "adds": (dict, {}),
}
_ERROR: schema.Keys = {
    **dict.fromkeys(("bias", "drift", "drift_as_speed"), (float, math.inf)),
    "ages_s": (list, list(UNBOUNDED.ages_s)),
}


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


def error_rows(content: Any, actuator: Actuator, where: str) -> Mapping[str, ErrorRow]:
    """Channel -> largest errors, of the channels that are named."""
    found = {}
    for channel, row in schema.rows(content, where).items():
        if channel not in actuator.sensors and actuator.base_parameters:
            raise ConfigurationError(
                f"{where}: {shown(channel)} is no sensor of {actuator.name}, known are "
                f"{', '.join(actuator.sensors)}"
            )
        values = schema.read(row, f"{where}: {channel}", _ERROR)
        ages = values.pop("ages_s")
        if not ages or not all(isinstance(age, float | int) and 0.0 < age < 1e4 for age in ages):
            raise ConfigurationError(
                f"{where}: {channel}: ages_s = {shown(ages)} must be times in s, above 0 and below"
                " 10000, at which a drift may be detected"
            )
        found[channel] = ErrorRow(**values, ages_s=tuple(map(float, ages)))
    return found


def _effect(row: Any, actuator: Actuator, where: str) -> EffectRow:
    values = schema.read(row, where, _EFFECT)
    if not values["sizes"]:
        raise ConfigurationError(f"{where}: sizes is empty; name at least one")
    sizes = tuple(_size(size, actuator, f"{where}: size") for size in values["sizes"])
    rough = values["roughness"]
    if not rough or not all(isinstance(r, float | int) and 0.0 <= r <= 1.0 for r in rough):
        raise ConfigurationError(f"{where}: roughness = {shown(rough)} must be shares from 0 to 1")
    return EffectRow(sizes, tuple(map(float, rough)), values["vibration_only"])


def _size(row: Any, actuator: Actuator, where: str) -> SizeRow:
    values = schema.read(row, where, _SIZE)
    where = f"{where} {shown(values['name'])}"
    base, physical = actuator.base_parameters, actuator.graph.parameters
    if values["of"]:
        _require(values["of"], base, "base parameter", where)
    moves = _amounts(values["moves"], base, "base parameter", f"{where}: moves")
    scales = _amounts(values["scales"], physical, "parameter", f"{where}: scales")
    opens = schema.texts(values["opens"], f"{where}: opens")
    for name in opens:
        _require(name, physical, "parameter", f"{where}: opens")
    texts = schema.pairs(values["adds"], f"{where}: adds")
    for name in texts:
        _require(name, actuator.residuals, "residual", f"{where}: adds")
    adds = tuple((name, monomial(text)) for name, text in texts.items())
    if not (moves or scales or opens or adds):
        raise ConfigurationError(
            f"{where} moves nothing; give moves, scales, opens or adds with what it changes"
        )
    if not values["low"] <= values["high"]:
        raise ConfigurationError(
            f"{where}: low = {values['low']} must be at most high = {values['high']}"
        )
    least = values["low"] if values["least"] is None else values["least"]
    extent = values["low"], values["high"], least, values["of"]
    bounds = SizeBounds(values["name"], values["unit"], *extent)
    return SizeRow(bounds, moves, scales, opens, adds)


def _amounts(content: Any, known: Collection[str], kind: str, where: str) -> Amounts:
    found = schema.numbers(content, where)
    for name in found:
        _require(name, known, kind, where)
    return tuple(found.items())


def _require(name: str, known: Collection[str], kind: str, where: str) -> None:
    if name not in known:
        raise ConfigurationError(
            f"{where}: {shown(name)} is no {kind} of the description, known are {', '.join(known)}"
        )
