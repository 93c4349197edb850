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

"""Judgements as DiagnosticArray: a record as rows that any viewer can show.

The key/values of the rows hold the record exactly (``key_values``); ``name``, ``level`` and
``message`` are for display. The first status is the record itself, followed by one status for each
of its parts (channel, symbol, candidate).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple, TypeVar

from flea_diag.errors import WireError, shown
from flea_diag.wire import records as r
from flea_diag.wire.messages.key_values import Pairs, arguments, key_values
from flea_diag.wire.wording import Words, words_of

R = TypeVar("R")
OF_STAND = "/actuator"
"""Ends the hardware_id of what has no serial: that of its stand."""
NAMES = ", "
"""Separates the names of the members in one value."""


class Status(NamedTuple):
    """One diagnostic_msgs/DiagnosticStatus."""

    level: int
    name: str
    message: str
    hardware_id: str
    values: Pairs


class RowField(NamedTuple):
    """A tuple field of a record that becomes rows; ``standing`` distinguishes two such fields.

    Where they are ``listed``, the record's own status names them all, and a candidate of which
    only the name is given has no row.
    """

    field: str
    row: type
    standing: str = ""
    listed: bool = False


ROWS: dict[type, tuple[RowField, ...]] = {
    r.ChannelTable: (RowField("channels", r.ChannelInfo),),
    r.DataQuality: (RowField("channels", r.ChannelQuality),),
    r.Symbols: (RowField("symbols", r.Symbol),),
    r.Hypotheses: (
        RowField("members", r.Candidate, "possible"),
        RowField("dropped", r.Candidate, "dropped"),
    ),
    r.AmbiguityGroup: (
        RowField("members", r.Candidate, "possible", listed=True),
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


def statuses(record: Any, stand: str) -> list[Status]:
    """Rows of a record, the record's own status first."""
    hardware = f"{stand}{OF_STAND}"
    if isinstance(record, r.Health):
        named = record.hardware or hardware
        return [Status(record.level, record.node, record.message, named, record.values)]
    rows = [_status(words_of(record), hardware, _head_values(record))]
    for table in ROWS.get(type(record), ()):
        standing = (("standing", table.standing),) if table.standing else ()
        for part in getattr(record, table.field):
            values = key_values(part)
            if not table.listed or values != (("fault", part.fault),):
                rows.append(_status(words_of(part, record), hardware, (*standing, *values)))
    return rows


def _status(words: Words, hardware: str, values: Pairs) -> Status:
    return Status(words.level, words.name, words.message, hardware, values)


def _elsewhere(record_type: type) -> tuple[str, ...]:
    """Fields that are not key/values of the first status: the stamp, and those that are rows."""
    return ("stamp_ns", *(table.field for table in ROWS.get(record_type, ())))


def _head_values(record: Any) -> Pairs:
    values = key_values(record, _elsewhere(type(record)))
    lists = tuple(
        (table.field, NAMES.join(part.fault for part in getattr(record, table.field)))
        for table in ROWS.get(type(record), ())
        if table.listed
    )
    first = FIRST_KEYS.get(type(record), ())
    known = dict((*values, *lists))
    return (
        *((key, known[key]) for key in first),
        *(pair for pair in values if pair[0] not in first),
    )


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
    head = rows[0].values
    for table in tables:
        if table.listed:
            parts[table.field] = _listed(table, dict(head).get(table.field, ""), parts[table.field])
    own = arguments(record_type, head, _elsewhere(record_type))
    return record_type(**{"stamp_ns": stamp_ns, **own, **parts})


def _health(stamp_ns: int, rows: Sequence[Status]) -> r.Health:
    if len(rows) > 1:
        raise WireError(f"Health: {len(rows)} statuses, must be 1")
    level, name, message, hardware, values = rows[0]
    serial = "" if hardware.endswith(OF_STAND) else hardware
    return r.Health(stamp_ns, name, r.Level(level), message, values, serial)


def _parts(table: RowField, rows: Sequence[Status]) -> tuple[Any, ...]:
    return tuple(
        table.row(**arguments(table.row, row.values))
        for row in rows
        if not table.standing or ("standing", table.standing) in row.values[:1]
    )


def _listed(table: RowField, names: str, parts: tuple[Any, ...]) -> tuple[Any, ...]:
    """The parts in the order of the list, those without a row by name only."""
    if not names:
        return parts
    rows = {part.fault: part for part in parts}
    listed = tuple(rows.pop(name, table.row(name)) for name in names.split(NAMES))
    if rows:
        raise WireError(
            f"{table.field}: status of {shown(next(iter(rows)))}, which is not in the list"
        )
    return listed
