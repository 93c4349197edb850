"""Frozen dataclasses from what a file of others holds, each field checked by its type.

The types of the fields are the schema: a number is finite and no truth value, a whole number fits
64 bits, a text is of bounded length, a tuple holds what it says. ``within`` adds a range. Missing
keys take the default of the field.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import MISSING, Field, field, fields, is_dataclass
from enum import Enum
from functools import cache
from types import NoneType, UnionType
from typing import Any, TypeVar, Union, get_args, get_origin, get_type_hints

from flea_diag.errors import shown

R = TypeVar("R")
Reader = Callable[[Any], Any]

LONGEST_TEXT = 10_000
LARGEST_INTEGER = 2**63


def within(low: float, high: float, default: Any = MISSING) -> Any:
    """Field whose number, or each of its numbers, lies in a range, both ends included."""
    return field(default=default, metadata={"range": (low, high)})


def record_of_fields(
    kind: type[R], content: object, *, finite: bool = True, strict: bool = True
) -> R:
    """The dataclass that a mapping describes.

    Parameters
    ----------
    finite
        Refuse numbers that are not finite.
    strict
        Refuse keys that no field has; otherwise they are not used.

    Raises
    ------
    ValueError
        In one line: the field, its value and what it must be.
    """
    wanted: Any = kind  # a type of dataclasses is hashable, what mypy does not see
    record: R = _record_reader(wanted, finite, strict)(content)
    return record


@cache
def _record_reader(kind: Any, finite: bool, strict: bool) -> Reader:
    hints = get_type_hints(kind)
    readers = {
        each.name: _field_reader(each, hints[each.name], finite, strict) for each in fields(kind)
    }
    required = [each.name for each in fields(kind) if _is_required(each)]

    def read(content: Any) -> Any:
        if not isinstance(content, Mapping):
            raise ValueError(f"{shown(content)} must be a mapping of {', '.join(readers)}")
        if strict and not content.keys() <= readers.keys():
            odd = next(key for key in content if key not in readers)
            raise ValueError(f"the key {shown(odd)} is unknown")
        given = {key: _field(key, content[key], readers[key]) for key in readers if key in content}
        if missing := [name for name in required if name not in given]:
            raise ValueError(f"the key {missing[0]!r} is missing")
        return kind(**given)

    return read


def _is_required(entry: Field[Any]) -> bool:
    return entry.default is MISSING and entry.default_factory is MISSING


def _field_reader(entry: Field[Any], hint: Any, finite: bool, strict: bool) -> Reader:
    read = _reader(hint, finite, strict)
    if "range" not in entry.metadata:
        return read
    low, high = entry.metadata["range"]

    def ranged(value: Any) -> Any:
        found = read(value)
        for number in found if isinstance(found, tuple) else (found,):
            if number is not None and not low <= number <= high:
                raise ValueError(f"{shown(number)} lies outside {low:g} to {high:g}")
        return found

    return ranged


def _field(name: str, value: Any, read: Reader) -> Any:
    try:
        return read(value)
    except ValueError as error:
        raise ValueError(f"{name}: {error}") from None


def _reader(hint: Any, finite: bool, strict: bool) -> Reader:
    """What reads a value of a type."""
    simple: dict[Any, Reader] = {
        str: _text, int: _whole, bool: _truth, Any: _anything,
        float: _finite if finite else _number,
    }  # fmt: skip
    if hint in simple:
        return simple[hint]
    origin, inside = get_origin(hint), get_args(hint)
    if origin in (Union, UnionType):
        return _optional(
            _reader(next(each for each in inside if each is not NoneType), finite, strict)
        )
    if origin is tuple:
        if inside[-1] is Ellipsis:
            return _row(_reader(inside[0], finite, strict))
        return _columns(tuple(_reader(each, finite, strict) for each in inside))
    if origin is not None and issubclass(origin, Mapping):
        return _table(_reader(inside[1], finite, strict))
    if isinstance(hint, type) and issubclass(hint, Enum):
        return _word(hint)
    if is_dataclass(hint):
        inner: Any = hint
        return _record_reader(inner, finite, strict)
    raise TypeError(f"no reader for {hint}")


def _text(value: Any) -> str:
    if not isinstance(value, str) or len(value) > LONGEST_TEXT:
        raise ValueError(f"{shown(value)} must be a text of at most {LONGEST_TEXT} characters")
    return value


def _whole(value: Any) -> int:
    if type(value) is not int or abs(value) >= LARGEST_INTEGER:
        raise ValueError(f"{shown(value)} must be a whole number of 64 bits")
    return value


def _truth(value: Any) -> bool:
    if not isinstance(value, bool):
        raise ValueError(f"{shown(value)} must be true or false")
    return value


def _anything(value: Any) -> Any:
    return value


def _number(value: Any) -> float:
    if type(value) is not float and (type(value) is not int or abs(value) >= LARGEST_INTEGER):
        raise ValueError(f"{shown(value)} must be a number")
    return float(value)


def _finite(value: Any) -> float:
    number = _number(value)
    if not math.isfinite(number):
        raise ValueError(f"{shown(value)} must be finite")
    return number


def _optional(read: Reader) -> Reader:
    return lambda value: None if value is None else read(value)


def _row(read: Reader) -> Reader:
    return lambda value: tuple(map(read, _list(value)))


def _columns(readers: tuple[Reader, ...]) -> Reader:
    def read(value: Any) -> tuple[Any, ...]:
        if len(_list(value)) != len(readers):
            raise ValueError(f"{shown(value)} must have {len(readers)} entries")
        return tuple(one(entry) for one, entry in zip(readers, value, strict=True))

    return read


def _list(value: Any) -> Any:
    if not isinstance(value, (list, tuple)):
        raise ValueError(f"{shown(value)} must be a list")
    return value


def _table(read: Reader) -> Reader:
    def read_table(value: Any) -> dict[str, Any]:
        if not isinstance(value, Mapping):
            raise ValueError(f"{shown(value)} must be a mapping")
        return {_text(key): _field(shown(key), entry, read) for key, entry in value.items()}

    return read_table


def _word(kind: type[Enum]) -> Reader:
    words = {each.value: each for each in kind}

    def read(value: Any) -> Enum:
        if not isinstance(value, str) or value not in words:
            raise ValueError(f"{shown(value)} must be one of {', '.join(map(str, words))}")
        return words[value]

    return read
