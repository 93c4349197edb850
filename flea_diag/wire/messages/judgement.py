"""Judgements as DiagnosticArray: a record as rows that any viewer can show.

The key/values of the rows hold the record exactly; ``name``, ``level`` and ``message`` are for
display. The first status is the record itself, followed by one status for each of its parts
(channel, symbol, candidate). Numbers are ``repr(float)`` and read back exactly; a list of strings
is JSON; pairs become one key each (``not_observable/spall``). Unknown keys are skipped and a
missing key takes the default of the field, so that old bags stay readable when fields are added.
"""

from __future__ import annotations

import dataclasses
import json
from collections.abc import Callable, Iterable, Sequence
from typing import Any, NamedTuple, TypeVar, get_type_hints

from flea_diag.errors import WireError, shown
from flea_diag.wire import records as r
from flea_diag.wire.json_text import parse_json
from flea_diag.wire.wording import Words, words_of

R = TypeVar("R")
Pairs = tuple[tuple[str, str], ...]


class Status(NamedTuple):
    """One diagnostic_msgs/DiagnosticStatus."""

    level: int
    name: str
    message: str
    hardware_id: str
    values: Pairs


class RowField(NamedTuple):
    """A tuple field of a record that becomes rows; ``standing`` distinguishes two such fields."""

    field: str
    row: type
    standing: str = ""


ROWS: dict[type, tuple[RowField, ...]] = {
    r.ChannelTable: (RowField("channels", r.ChannelInfo),),
    r.DataQuality: (RowField("channels", r.ChannelQuality),),
    r.Symbols: (RowField("symbols", r.Symbol),),
    r.AmbiguityGroup: (
        RowField("members", r.Candidate, "possible"),
        RowField("dropped", r.Candidate, "dropped"),
    ),
}

FIRST_KEYS: dict[type, tuple[str, ...]] = {
    r.AmbiguityGroup: (
        "outcome",
        "episode",
        "step",
        "seq",
        "members",
        "detected_stamp_ns",
        "calibration_sha256",
        "source",
    ),
}
"""Keys with a guaranteed order; the others follow in the order of the record's fields."""

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


def _json_text(value: Iterable[Any]) -> str:
    return json.dumps(list(value), ensure_ascii=False)


def _strings(text: str) -> tuple[str, ...]:
    value = parse_json(text)
    if not isinstance(value, list) or not all(isinstance(item, str) for item in value):
        raise ValueError("is not a list of strings")
    return tuple(value)


_TEXT: dict[Any, tuple[Callable[[Any], str], Callable[[str], Any]]] = {
    str: (str, str),
    int: (_int_text, _int),
    float: (lambda value: repr(float(value)), float),
    bool: (lambda value: "true" if value else "false", {"true": True, "false": False}.__getitem__),
    r.Outcome: (lambda value: str(value.value), r.Outcome),
    r.Quality: (lambda value: str(value.value), r.Quality),
    r.RemarkKind: (lambda value: str(value.value), r.RemarkKind),
    tuple[str, ...]: (_json_text, _strings),
}
"""Type of a field -> its writer and its reader."""

_EXPECTED: dict[Any, str] = {
    int: "integer",
    float: "number",
    bool: "boolean",
    r.Outcome: "outcome",
    r.Quality: "quality",
    r.RemarkKind: "kind of remark",
}
"""Type of a field -> its name in an error."""

_PAIRS: dict[Any, Any] = {
    tuple[tuple[str, str], ...]: str,
    tuple[tuple[str, int], ...]: int,
}
"""Fields that become one key per pair -> type of the second element of a pair."""

_NESTED: dict[Any, Any] = {
    tuple[r.Evidence, ...]: r.Evidence,
    tuple[r.NextTest, ...]: r.NextTest,
    tuple[r.UnitOffset, ...]: r.UnitOffset,
}
"""Fields that become one key with a JSON object per part -> class of a part."""


class _Field(NamedTuple):
    name: str
    kind: Any
    required: bool


def _fields(record_type: type) -> tuple[_Field, ...]:
    hints = get_type_hints(record_type)
    tables = {row.field for row in ROWS.get(record_type, ())} | {"stamp_ns"}
    if record_type is r.Evidence:
        tables = set()
    return tuple(
        _Field(entry.name, hints[entry.name], entry.default is dataclasses.MISSING)
        for entry in dataclasses.fields(record_type)
        if entry.name not in tables
    )


_KINDS = (
    r.ChannelTable,
    r.DataQuality,
    r.Detection,
    r.Symbols,
    r.AmbiguityGroup,
    r.FeatureRequest,
    r.FeatureValue,
    r.Truth,
    r.Remark,
    r.ChannelInfo,
    r.ChannelQuality,
    r.Symbol,
    r.Candidate,
    r.Evidence,
    r.NextTest,
    r.UnitOffset,
)
_LAYOUT: dict[type, tuple[_Field, ...]] = {kind: _fields(kind) for kind in _KINDS}


def statuses(record: Any, stand: str) -> list[Status]:
    """Rows of a record, the record's own status first."""
    hardware = f"{stand}/actuator"
    if isinstance(record, r.Health):
        return [Status(record.level, record.node, record.message, hardware, record.values)]
    rows = [_status(words_of(record), hardware, _head_values(record))]
    for table in ROWS.get(type(record), ()):
        standing = (("standing", table.standing),) if table.standing else ()
        for part in getattr(record, table.field):
            values = (*standing, *_values(part))
            rows.append(_status(words_of(part, record), hardware, values))
    return rows


def _status(words: Words, hardware: str, values: Pairs) -> Status:
    return Status(words.level, words.name, words.message, hardware, values)


def _head_values(record: Any) -> Pairs:
    values = _values(record)
    first = FIRST_KEYS.get(type(record))
    if first is None:
        return values
    known = dict(values)
    known["members"] = ", ".join(candidate.fault for candidate in record.members)
    return (
        *((key, known[key]) for key in first),
        *(pair for pair in values if pair[0] not in first),
    )


def _values(value: Any) -> Pairs:
    """Every field of a dataclass as key/values."""
    pairs: list[tuple[str, str]] = []
    for name, kind, _ in _LAYOUT[type(value)]:
        content = getattr(value, name)
        if kind in _TEXT:
            pairs.append((name, _TEXT[kind][0](content)))
        elif kind in _PAIRS:
            write = _TEXT[_PAIRS[kind]][0]
            pairs += [(f"{name}/{key}", write(item)) for key, item in content]
        else:
            pairs += [
                (f"{name}/{number}", json.dumps(dict(_values(item)), ensure_ascii=False))
                for number, item in enumerate(content, 1)
            ]
    return tuple(pairs)


def record_of(record_type: type[R], stamp_ns: int, rows: Sequence[Status]) -> R:
    """Read back the record that ``statuses`` wrote.

    Raises
    ------
    WireError
        Names the key that is missing or invalid.
    """
    if not rows:
        raise WireError(f"{record_type.__name__}: the DiagnosticArray is empty")
    if record_type is r.Health:
        return _health(stamp_ns, rows)  # type: ignore[return-value]
    tables = ROWS.get(record_type, ())
    if not tables and len(rows) > 1:
        raise WireError(f"{record_type.__name__}: {len(rows)} statuses, must be 1")
    parts = {table.field: _parts(table, rows[1:]) for table in tables}
    stray = len(rows) - 1 - sum(map(len, parts.values()))
    if stray:
        raise WireError(f"{record_type.__name__}: {stray} statuses with an unknown standing")
    content = {"stamp_ns": stamp_ns, **_read(record_type, rows[0].values), **parts}
    return record_type(**content)


def _health(stamp_ns: int, rows: Sequence[Status]) -> r.Health:
    if len(rows) > 1:
        raise WireError(f"Health: {len(rows)} statuses, must be 1")
    return r.Health(stamp_ns, rows[0].name, r.Level(rows[0].level), rows[0].message, rows[0].values)


def _parts(table: RowField, rows: Sequence[Status]) -> tuple[Any, ...]:
    return tuple(
        table.row(**_read(table.row, row.values))
        for row in rows
        if not table.standing or ("standing", table.standing) in row.values[:1]
    )


def _read(kind: type, values: Pairs) -> dict[str, Any]:
    """Keyword arguments of a dataclass from key/values."""
    known = dict(values)
    content: dict[str, Any] = {}
    for name, hint, required in _LAYOUT[kind]:
        where = f"{kind.__name__}.{name}"
        if hint in _TEXT:
            if name in known:
                content[name] = _scalar(hint, known[name], where)
            elif required:
                raise WireError(f"{where}: key {name!r} is missing in the message")
        elif hint in _PAIRS:
            content[name] = _read_pairs(f"{name}/", _PAIRS[hint], values, where)
        elif hint in _NESTED:
            part = _NESTED[hint]
            content[name] = tuple(
                part(**_read(part, _json_object(text, where)))
                for key, text in values
                if key.startswith(f"{name}/")
            )
    return content


def _read_pairs(prefix: str, kind: Any, values: Pairs, where: str) -> tuple[tuple[str, Any], ...]:
    return tuple(
        (key[len(prefix) :], _scalar(kind, text, where))
        for key, text in values
        if key.startswith(prefix)
    )


def _scalar(kind: Any, text: str, where: str) -> Any:
    try:
        return _TEXT[kind][1](text)
    except (ValueError, KeyError):
        expected = _EXPECTED.get(kind, "list of strings")
        raise WireError(f"{where}: {shown(text)} is not a valid {expected}") from None


def _json_object(text: str, where: str) -> Pairs:
    try:
        content = parse_json(text)
    except ValueError:
        content = None
    if not isinstance(content, dict) or not all(isinstance(v, str) for v in content.values()):
        raise WireError(f"{where}: {shown(text)} is not a JSON object of strings")
    return tuple(content.items())
