"""Validation of user-written mappings: known keys of the right type, all else is refused."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from flea_diag.errors import ConfigurationError, shown

REQUIRED = object()
"""Marks a key without a default."""


Keys = Mapping[str, tuple[type, Any]]
"""Key -> (type, default)."""


def read(content: Any, where: str, keys: Keys) -> dict[str, Any]:
    """Values of a mapping by key.

    Parameters
    ----------
    content
        Parsed YAML at this place.
    where
        Name of the place, for messages.
    keys
        Key -> (type, default); the default ``REQUIRED`` makes the key obligatory.

    Raises
    ------
    ConfigurationError
        Names the place, the key, the value and the type or limit.
    """
    if not isinstance(content, Mapping):
        raise ConfigurationError(
            f"{where} is {kind_name(content)}, it must be a mapping of {', '.join(keys)}"
        )
    unknown = [key for key in content if key not in keys]
    if unknown:
        raise ConfigurationError(
            f"{where}: unknown key {shown(unknown[0])}, known are {', '.join(keys)}"
        )
    return {
        key: _value(content.get(key, default), kind, f"{where}: {key}", default)
        for key, (kind, default) in keys.items()
    }


def _value(value: Any, kind: Any, where: str, default: Any) -> Any:
    if value is REQUIRED:
        raise ConfigurationError(f"{where} is missing; give it")
    if value is default:
        return value
    if kind is float and isinstance(value, int) and not isinstance(value, bool):
        # Beyond a float's range it is refused like any number that is not finite.
        value = float(value) if abs(value) < 2**1023 else math.inf
    if not isinstance(value, kind) or (kind is not bool and isinstance(value, bool)):
        hint = " (YAML reads 5e6 as text, write 5.0e+6)" if isinstance(value, str) else ""
        raise ConfigurationError(
            f"{where} = {shown(value)} is {kind_name(value)}, it must be a {_WORD[kind]}{hint}"
        )
    if kind is float:
        _check_number(value, where)
    return value


SMALLEST, LARGEST = 1e-15, 1e15
"""Magnitudes that a quantity in SI units may have; values outside are taken for a unit error."""


def _check_number(value: float, where: str) -> None:
    if not math.isfinite(value):
        raise ConfigurationError(f"{where} = {value!r} must be finite")
    if value and not SMALLEST <= abs(value) <= LARGEST:
        raise ConfigurationError(
            f"{where} = {value!r} lies outside {SMALLEST:g} to {LARGEST:g}; check its unit"
        )


_WORD: dict[Any, str] = {
    float: "number",
    str: "text",
    bool: "true or false",
    list: "list",
    dict: "mapping",
    int: "whole number",
}


def kind_name(value: Any) -> str:
    """Word for the type of a value, for messages."""
    return "nothing" if value is None else f"a {_WORD.get(type(value), type(value).__name__)}"


def texts(values: Any, where: str) -> tuple[str, ...]:
    """A list of texts."""
    if not isinstance(values, list) or not all(isinstance(value, str) for value in values):
        raise ConfigurationError(f"{where} = {shown(values)} must be a list of names")
    return tuple(values)


def rows(content: Any, where: str) -> dict[str, Any]:
    """A mapping of name -> row."""
    if not isinstance(content, Mapping) or not all(isinstance(key, str) for key in content):
        raise ConfigurationError(f"{where} is {kind_name(content)}, it must map names to rows")
    return dict(content)


def pairs(content: Any, where: str) -> dict[str, str]:
    """A mapping of name -> name."""
    found = rows(content, where)
    if not all(isinstance(value, str) for value in found.values()):
        raise ConfigurationError(f"{where} = {shown(found)} must map names to names")
    return found


def numbers(content: Any, where: str) -> dict[str, float]:
    """A mapping of name -> number."""
    keys = dict.fromkeys(rows(content, where), (float, REQUIRED))
    return read(content, where, keys)
