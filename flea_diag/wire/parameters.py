"""Parameters as frozen dataclasses: default, unit, bounds and description in one place.

ROS parameters, YAML files and ``--help`` are generated from the same fields. A class is
written ``@dataclass(frozen=True) class P: rate_hz: float = parameter(100.0, "...", unit="Hz",
minimum=1.0, maximum=1000.0)``.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import MISSING, Field, dataclass, field, fields
from typing import Any, TypeVar

from flea_diag.errors import ConfigurationError, shown

P = TypeVar("P")
Value = Any


@dataclass(frozen=True)
class Descriptor:
    """Description of one parameter, without its value."""

    name: str
    kind: type
    default: Value
    doc: str
    unit: str
    minimum: float | None
    maximum: float | None
    choices: tuple[str, ...]
    read_only: bool


def parameter(
    default: Value,
    doc: str,
    *,
    unit: str = "",
    minimum: float | None = None,
    maximum: float | None = None,
    choices: tuple[str, ...] = (),
    read_only: bool = False,
) -> Any:
    """A dataclass field with unit, bounds and description."""
    return field(
        default=default,
        metadata={
            "doc": doc,
            "unit": unit,
            "minimum": minimum,
            "maximum": maximum,
            "choices": choices,
            "read_only": read_only,
        },
    )


def descriptors(parameters: type) -> tuple[Descriptor, ...]:
    """Descriptors of all parameters of a class, in order; other fields are skipped."""
    return tuple(_descriptor(entry) for entry in fields(parameters) if "doc" in entry.metadata)


def _descriptor(entry: Field[Any]) -> Descriptor:
    if entry.default is MISSING:
        raise TypeError(f"parameter {entry.name} has no default")
    return Descriptor(entry.name, type(entry.default), entry.default, **entry.metadata)


def checked(descriptor: Descriptor, value: Value, where: str) -> Value:
    """Value of the right type and within its bounds; an integer is accepted for a float.

    A float must be finite. The one exception is NaN as its own default, which means "not given".

    Raises
    ------
    ConfigurationError
        Names the parameter, the value, the limit and the source of the value.
    """
    name, kind = descriptor.name, descriptor.kind
    if kind is float and isinstance(value, int) and not isinstance(value, bool):
        # An integer beyond the range of a float is refused as infinite.
        value = float(value) if abs(value) < 2**1023 else math.inf if value > 0 else -math.inf
    said = f"{where}: {name} = {shown(value)}"
    if type(value) is not kind:
        raise ConfigurationError(f"{said} must be {_NAME[kind]}")
    if descriptor.choices and value not in descriptor.choices:
        raise ConfigurationError(
            f"{said} is unknown, choose one of {', '.join(descriptor.choices)}"
        )
    _check_bounds(descriptor, value, where)
    return value


_NAME: dict[type, str] = {
    bool: "true or false",
    int: "an integer",
    float: "a number",
    str: "text",
    tuple: "a list",
}
"""Type of a parameter -> its name in an error."""


def _check_bounds(descriptor: Descriptor, value: Value, where: str) -> None:
    unit = f" {descriptor.unit}" if descriptor.unit not in ("", "1") else ""
    given = f"{where}: {descriptor.name} = {shown(value)}{unit}"
    if descriptor.kind is float and math.isnan(value):
        if math.isnan(descriptor.default):
            return
        raise ConfigurationError(f"{given} must be a finite number")
    if descriptor.minimum is not None and value < descriptor.minimum:
        raise ConfigurationError(f"{given} is below its limit {descriptor.minimum!r}{unit}")
    if descriptor.maximum is not None and value > descriptor.maximum:
        raise ConfigurationError(f"{given} is above its limit {descriptor.maximum!r}{unit}")
    if descriptor.kind is float and math.isinf(value):
        raise ConfigurationError(f"{given} must be a finite number")


def build(parameters: type[P], values: Mapping[str, Value], where: str) -> P:
    """Parameter object from a mapping; unknown keys and invalid values are refused by name."""
    known = {entry.name: entry for entry in descriptors(parameters)}
    unknown = sorted(set(values) - set(known), key=repr)
    if unknown:
        raise ConfigurationError(
            f"{where}: unknown parameter {shown(unknown[0])}, known are {', '.join(sorted(known))}"
        )
    return parameters(**{key: checked(known[key], value, where) for key, value in values.items()})
