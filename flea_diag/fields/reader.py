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

"""The one reader of what others wrote: values by their declared types, each field checked.

The types of a dataclass are the schema of its file: a number is finite and of a likely size, a
whole number fits 64 bits, a text is of bounded length, a tuple holds what it says. ``FieldLimits``
in a type narrow its numbers and words, as those of a parameter do; what holds between fields the
``__post_init__`` of the record checks by a ValueError. Missing keys take the default.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import MISSING, Field, fields, is_dataclass, replace
from enum import Enum
from functools import cache
from types import NoneType, UnionType
from typing import Annotated, Any, TypeVar, Union, get_args, get_origin, get_type_hints

from flea_diag.errors import LONGEST_SHOWN, ConfigurationError, shown
from flea_diag.fields.values import (
    IN_SI,
    LONGEST_TEXT,
    SIMPLE,
    FieldLimits,
    FieldRules,
    Reader,
    Refusal,
    WrittenAs,
    anything,
    refused,
)

R = TypeVar("R")


def read_as(
    kind: type[R],
    content: object,
    where: str = "",
    *,
    error: type[Exception] = ConfigurationError,
    magnitudes: tuple[float, float] | None = IN_SI,
    strict: bool = True,
    given: Mapping[str, Any] | None = None,
) -> R:
    """Content as a value of this type: a dataclass, or a type such as ``dict[str, float]``.

    Parameters
    ----------
    where
        Name of the place, for messages.
    magnitudes
        Smallest and largest of a number that is not 0; ``ANY`` takes what is not finite too.
    strict
        Refuse keys that no field has; otherwise they are not used.
    given
        Fields of the dataclass that the caller knows; the content must not hold them.

    Raises
    ------
    Exception
        Of the type ``error``, in one line: the place, the value and what it must be.
    """
    wanted: Any = kind  # a type is hashable, what mypy does not see
    rules = FieldRules(magnitudes, strict)
    try:
        if given:
            made: R = _record(wanted, rules, frozenset(given))(content, given)
        else:
            made = _reader(wanted, rules, FieldLimits())(content)
    except Refusal as refusal:
        raise error(f"{where}{refusal}" if where else str(refusal).removeprefix(": ")) from None
    return made


@cache
def _record(kind: Any, rules: FieldRules, given: frozenset[str]) -> Callable[[Any, Any], Any]:
    hints = get_type_hints(kind, include_extras=True)
    known = [each for each in fields(kind) if each.name not in given]
    names = {_key(hints[each.name]) or each.name: each.name for each in known}
    word = "parameter" if any("doc" in each.metadata for each in known) else "key"
    required = [key for key, each in zip(names, known, strict=True) if _is_required(each)]
    readers = {key: _reader(hints[each.name], rules, _limits(each))
               for key, each in zip(names, known, strict=True)}  # fmt: skip

    def read(content: Any, more: Mapping[str, Any]) -> Any:
        if not isinstance(content, Mapping):
            raise refused(content, f"must be a mapping of {', '.join(readers)}")
        if rules.strict and not content.keys() <= readers.keys():
            odd = next(key for key in content if key not in readers)
            raise Refusal(f": unknown {word} {shown(odd)}, known are {', '.join(readers)}")
        if missing := [name for name in required if name not in content]:
            raise Refusal(f": {missing[0]} is missing; give it")
        found = {names[key]: _at(f": {key}", content[key], one)
                 for key, one in readers.items() if key in content}  # fmt: skip
        try:
            return kind(**found, **more)
        except ValueError as wrong:
            raise Refusal(f": {wrong}") from None

    return read


def _is_required(entry: Field[Any]) -> bool:
    return entry.default is MISSING and entry.default_factory is MISSING


def _key(hint: Any) -> str:
    return next((each.key for each in get_args(hint) if isinstance(each, WrittenAs)), "")


def _limits(entry: Field[Any]) -> FieldLimits:
    """Those of a parameter; NaN as its default means that a number may be left open."""
    known = {each.name for each in fields(FieldLimits)}
    told: dict[str, Any] = {key: value for key, value in entry.metadata.items() if key in known}
    is_open = isinstance(entry.default, float) and math.isnan(entry.default)
    return FieldLimits(**told, open=math.nan if is_open else None)


def _at(place: str, value: Any, read: Reader) -> Any:
    try:
        return read(value)
    except Refusal as words:
        raise Refusal(f"{place}{words}") from None


@cache
def _reader(hint: Any, rules: FieldRules, limits: FieldLimits) -> Reader:
    """What reads a value of a type; the limits hold for each number and each text in it."""
    if hint is Any or hint is object:
        return anything
    if hint in SIMPLE:
        return SIMPLE[hint](rules, limits)
    origin, inside = get_origin(hint), get_args(hint)
    if origin is Annotated:
        stated = next((each for each in inside if isinstance(each, FieldLimits)), limits)
        left_open = limits.open if stated.open is None else stated.open
        return _reader(inside[0], rules, replace(stated, open=left_open))
    if origin in (Union, UnionType):
        (one,) = (each for each in inside if each is not NoneType)
        return _optional(_reader(one, rules, limits))
    if origin is tuple:
        if inside[-1] is Ellipsis:
            return _row(_reader(inside[0], rules, limits))
        return _columns(tuple(_reader(each, rules, limits) for each in inside))
    if origin is not None and issubclass(origin, Mapping):
        return _table(_reader(inside[1], rules, limits))
    if isinstance(hint, type) and issubclass(hint, Enum):
        return _word(hint)
    if is_dataclass(hint):
        wanted: Any = hint
        read = _record(wanted, rules, frozenset())
        return lambda value: read(value, {})
    raise TypeError(f"no reader for {hint}")


def _optional(read: Reader) -> Reader:
    return lambda value: None if value is None else read(value)


def _list(value: Any) -> Any:
    if not isinstance(value, list | tuple):
        raise refused(value, "must be a list")
    return value


def _row(read: Reader) -> Reader:
    def read_row(value: Any) -> tuple[Any, ...]:
        entries, made = _list(value), []
        try:
            for entry in entries:
                made.append(read(entry))
        except Refusal as words:
            raise Refusal(f"[{len(made)}]{words}") from None
        return tuple(made)

    return read_row


def _columns(readers: tuple[Reader, ...]) -> Reader:
    def read_columns(value: Any) -> tuple[Any, ...]:
        if len(_list(value)) != len(readers):
            raise refused(value, f"must have {len(readers)} entries")
        return tuple(_at(f"[{k}]", value[k], read) for k, read in enumerate(readers))

    return read_columns


def _table(read: Reader) -> Reader:
    def read_table(value: Any) -> dict[str, Any]:
        if not isinstance(value, Mapping):
            raise refused(value, "must be a mapping")
        return {_name(key): _at(f": {_said(key)}", entry, read) for key, entry in value.items()}

    return read_table


def _name(key: Any) -> str:
    if not isinstance(key, str) or len(key) > LONGEST_TEXT:
        raise Refusal(f": the key {shown(key)} must be text")
    return key


def _said(key: Any) -> str:
    plain = isinstance(key, str) and key.isidentifier() and len(key) <= LONGEST_SHOWN
    return str(key) if plain else shown(key)


def _word(kind: type[Enum]) -> Reader:
    words = {each.value: each for each in kind}

    def read_word(value: Any) -> Enum:
        if not isinstance(value, str) or value not in words:
            raise refused(value, f"is unknown, choose one of {', '.join(map(str, words))}")
        return words[value]

    return read_word
