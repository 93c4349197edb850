"""Parameters as frozen dataclasses: default, unit, bounds and prose stand once.

ROS parameters, YAML files and ``--help`` are all made from the same fields. A class is
written ``@dataclass(frozen=True) class P: rate_hz: float = parameter(100.0, "...", unit="Hz",
minimum=1.0, maximum=1000.0)``.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import MISSING, Field, dataclass, field, fields
from typing import Any, TypeVar, cast

from flea_diag.errors import ConfigurationError

P = TypeVar("P")
Value = Any


@dataclass(frozen=True)
class Descriptor:
    """What is known of one parameter besides its value."""

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
    """A dataclass field that carries its unit, bounds and prose."""
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
    """Descriptors of all parameters of a class, in order; its other fields are left out."""
    return tuple(_descriptor(entry) for entry in fields(parameters) if "doc" in entry.metadata)


def _descriptor(entry: Field[Any]) -> Descriptor:
    if entry.default is MISSING:
        raise TypeError(f"parameter {entry.name} has no default")
    return Descriptor(entry.name, type(entry.default), entry.default, **entry.metadata)


def checked(descriptor: Descriptor, value: Value, where: str) -> Value:
    """Value of the right type and inside its bounds.

    Raises
    ------
    ConfigurationError
        Naming the parameter, the value, the limit and where it came from.
    """
    name, kind = descriptor.name, descriptor.kind
    if kind is float and isinstance(value, int) and not isinstance(value, bool):
        # Beyond a float's range it is refused like any that is above its limit.
        value = float(value) if abs(value) < 2**1023 else math.inf if value > 0 else -math.inf
    if type(value) is not kind:
        raise ConfigurationError(
            f"{where}: {name} = {value!r} is a {type(value).__name__}, it must be a {kind.__name__}"
        )
    unit = f" {descriptor.unit}" if descriptor.unit else ""
    if descriptor.choices and value not in descriptor.choices:
        raise ConfigurationError(
            f"{where}: {name} = {value!r} is unknown, choose one of {', '.join(descriptor.choices)}"
        )
    value = cast(Value, value)  # mypy has narrowed it to object
    # Written so that NaN, which compares false with everything, is refused too.
    if descriptor.minimum is not None and not value >= descriptor.minimum:
        raise ConfigurationError(
            f"{where}: {name} = {value!r}{unit} is below its limit {descriptor.minimum!r}{unit}"
        )
    if descriptor.maximum is not None and not value <= descriptor.maximum:
        raise ConfigurationError(
            f"{where}: {name} = {value!r}{unit} is above its limit {descriptor.maximum!r}{unit}"
        )
    return value


def build(parameters: type[P], values: Mapping[str, Value], where: str) -> P:
    """Parameter object from a mapping; unknown keys and bad values are refused by name."""
    known = {entry.name: entry for entry in descriptors(parameters)}
    unknown = sorted(set(values) - set(known), key=repr)
    if unknown:
        raise ConfigurationError(
            f"{where}: unknown parameter {unknown[0]!r}, known are {', '.join(sorted(known))}"
        )
    return parameters(**{key: checked(known[key], value, where) for key, value in values.items()})
