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

"""A dataclass as the key/values of one status, and back.

Every value has a key of its own: numbers are ``repr(float)`` and read back exactly, a list has one
numbered key per item (``features_computed/1``), an object one key per field
(``evidence/1/source``), and pairs become one key each (``not_observable/spall``). An optional text
that is empty and an optional number that is unknown have no key. Unknown keys are skipped and a
missing key takes the default of the field, so that old bags stay readable when fields are added.
Older bags hold lists and objects as JSON, which is still read.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Iterator
from typing import Any, NamedTuple, get_type_hints

from flea_diag.errors import WireError, shown
from flea_diag.wire import records as r
from flea_diag.wire.json_text import parse_json

Pairs = tuple[tuple[str, str], ...]

_INT64 = range(-(2**63), 2**63)


def _int_text(value: int) -> str:
    if int(value) not in _INT64:
        raise WireError(f"number {shown(value)} does not fit 64 bits")
    return str(int(value))


def _int(text: str) -> int:
    value = int(text) if len(text) <= 20 else _INT64.stop
    if value not in _INT64:
        raise ValueError("does not fit 64 bits")
    return value


_TEXT: dict[Any, tuple[Callable[[Any], str], Callable[[str], Any]]] = {
    str: (str, str),
    int: (_int_text, _int),
    float: (lambda value: repr(float(value)), float),
    bool: (lambda value: "true" if value else "false", {"true": True, "false": False}.__getitem__),
    r.Outcome: (lambda value: str(value.value), r.Outcome),
    r.Quality: (lambda value: str(value.value), r.Quality),
    r.RemarkKind: (lambda value: str(value.value), r.RemarkKind),
    r.Cause: (lambda value: str(value.value), r.Cause),
}
"""Type of a field -> its writer and its reader."""

_EXPECTED: dict[Any, str] = {
    int: "integer",
    float: "number",
    bool: "boolean",
    r.Outcome: "outcome",
    r.Quality: "quality",
    r.RemarkKind: "kind of remark",
    r.Cause: "cause",
}
"""Type of a field -> its name in an error."""

_LIST = tuple[str, ...]
_PAIRS: dict[Any, Any] = {
    tuple[tuple[str, str], ...]: str,
    tuple[tuple[str, int], ...]: int,
}
"""Fields that become one key per pair -> type of the second element of a pair."""

_OBJECTS: dict[Any, Any] = {
    tuple[r.Evidence, ...]: r.Evidence,
    tuple[r.NextTest, ...]: r.NextTest,
    tuple[r.UnitOffset, ...]: r.UnitOffset,
    tuple[r.JudgedTest, ...]: r.JudgedTest,
    tuple[r.TwoFaults, ...]: r.TwoFaults,
    tuple[r.Recurrence, ...]: r.Recurrence,
    tuple[r.SizeAt, ...]: r.SizeAt,
}
"""Fields that become numbered objects -> class of an object."""

_UNKNOWN = ("", "nan")
"""Texts that are not written where they are the default."""


class _Field(NamedTuple):
    name: str
    kind: Any
    required: bool
    unknown: str | None
    """Text of the default for which no key is written."""


_LAYOUT: dict[tuple[type, tuple[str, ...]], tuple[_Field, ...]] = {}


def _fields(record_type: type, elsewhere: tuple[str, ...]) -> tuple[_Field, ...]:
    """Fields of a dataclass that are key/values; ``elsewhere`` are held by other means."""
    key = record_type, elsewhere
    if key not in _LAYOUT:
        hints = get_type_hints(record_type)
        _LAYOUT[key] = tuple(
            _field(entry, hints[entry.name])
            for entry in dataclasses.fields(record_type)
            if entry.name not in elsewhere
        )
    return _LAYOUT[key]


def _field(entry: dataclasses.Field[Any], kind: Any) -> _Field:
    required = entry.default is dataclasses.MISSING
    text = None if required or kind not in _TEXT else _TEXT[kind][0](entry.default)
    return _Field(entry.name, kind, required, text if text in _UNKNOWN else None)


def key_values(value: Any, elsewhere: tuple[str, ...] = ()) -> Pairs:
    """Every field of a dataclass as key/values, but for those named ``elsewhere``."""
    return tuple(_written(value, elsewhere))


def _written(value: Any, elsewhere: tuple[str, ...] = ()) -> Iterator[tuple[str, str]]:
    for name, kind, _, unknown in _fields(type(value), elsewhere):
        content = getattr(value, name)
        if kind in _TEXT:
            text = _TEXT[kind][0](content)
            if text != unknown:
                yield name, text
        elif kind in _PAIRS:
            write = _TEXT[_PAIRS[kind]][0]
            yield from ((f"{name}/{key}", write(item)) for key, item in content)
        elif kind == _LIST:
            yield from ((f"{name}/{number}", item) for number, item in enumerate(content, 1))
        else:
            for number, item in enumerate(content, 1):
                yield from ((f"{name}/{number}/{key}", text) for key, text in _written(item))


def arguments(kind: type, values: Pairs, elsewhere: tuple[str, ...] = ()) -> dict[str, Any]:
    """Keyword arguments of a dataclass from key/values.

    Raises
    ------
    WireError
        Names the key that is missing or invalid.
    """
    known = dict(values)
    content: dict[str, Any] = {}
    for name, hint, required, _ in _fields(kind, elsewhere):
        where = f"{kind.__name__}.{name}"
        if hint in _TEXT:
            if name in known:
                content[name] = _scalar(hint, known[name], where)
            elif required:
                raise WireError(f"{where}: key {name!r} is missing in the message")
        elif hint in _PAIRS:
            below = _below(name, values)
            content[name] = tuple((key, _scalar(_PAIRS[hint], text, where)) for key, text in below)
        elif hint == _LIST:
            listed = tuple(text for _, text in _below(name, values))
            content[name] = _json_list(known[name], where) if name in known else listed
        else:
            content[name] = _objects(_OBJECTS[hint], _below(name, values), where)
    return content


def _below(name: str, values: Pairs) -> Pairs:
    """Key/values below a name, without it."""
    prefix = f"{name}/"
    return tuple((key[len(prefix) :], text) for key, text in values if key.startswith(prefix))


def _objects(kind: type, values: Pairs, where: str) -> tuple[Any, ...]:
    found: dict[str, list[tuple[str, str]]] = {}
    for key, text in values:
        number, is_field, name = key.partition("/")
        pairs = [(name, text)] if is_field else list(_json_object(text, where))
        found.setdefault(number, []).extend(pairs)
    return tuple(kind(**arguments(kind, tuple(pairs))) for pairs in found.values())


def _scalar(kind: Any, text: str, where: str) -> Any:
    try:
        return _TEXT[kind][1](text)
    except (ValueError, KeyError):
        raise WireError(f"{where}: {shown(text)} is not a valid {_EXPECTED[kind]}") from None


# --- JSON in older bags -----------------------------------------------------------------


def _json(text: str) -> Any:
    try:
        return parse_json(text)
    except ValueError:
        return None


def _json_list(text: str, where: str) -> tuple[str, ...]:
    content = _json(text)
    if not isinstance(content, list) or not all(isinstance(item, str) for item in content):
        raise WireError(f"{where}: {shown(text)} is not a valid list of strings")
    return tuple(content)


def _json_object(text: str, where: str) -> Pairs:
    content = _json(text)
    if not isinstance(content, dict) or not all(isinstance(v, str) for v in content.values()):
        raise WireError(f"{where}: {shown(text)} is not a JSON object of strings")
    return tuple(content.items())
