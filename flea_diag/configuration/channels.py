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

"""``channels.yaml``: where the channels of a stand come from, read into a ``SourceMapping``."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Mapping
from datetime import datetime, timezone

from flea_diag.configuration.channel_rows import (
    AccelerometerRow,
    ChannelRow,
    ChannelsFile,
    PlaceTerm,
    TimeColumn,
)
from flea_diag.configuration.description import described
from flea_diag.configuration.files import load_yaml
from flea_diag.configuration.stand import STAND_FILE, Stand
from flea_diag.core.symbolic.converted_unit import conversion_to
from flea_diag.errors import ConfigurationError, shown
from flea_diag.fields.reader import read_as
from flea_diag.formats import migrated
from flea_diag.wire.sources.field_path import FieldPath
from flea_diag.wire.sources.mapping import (
    AGE_READINGS,
    DATENUM,
    DATENUM_OF_1970,
    FLEA_TEXT,
    AxisMapping,
    ChannelMapping,
    SourceMapping,
    SourceTerm,
    TableTime,
)
from flea_diag.wire.topics import POINT_CLOUD

SLOWEST_HZ, FASTEST_HZ = 1.0, 1000.0
"""Rates that scans may have."""
MOST_TERMS = 200
_ACCELEROMETER = re.compile(r"accelerometer_[1-9]\d?")


def channel_sources(stand: Stand) -> SourceMapping:
    """The mapping of a stand.

    Raises
    ------
    ConfigurationError
        It has none, or it is refused; names the file, the place, the value and the remedy.
    """
    if stand.channels is None:
        raise ConfigurationError(
            f"{stand.folder / STAND_FILE} names no channels: write a channels.yaml that says where "
            "they come from, and name it there (channels: channels.yaml)"
        )
    where = str(stand.channels)
    known = read_as(
        ChannelsFile, migrated("channel mapping", load_yaml(stand.channels), where), where
    )
    if known.format == FLEA_TEXT:
        return SourceMapping(where, stand.name, FLEA_TEXT, 100.0, ())
    rate_hz = _rate(known.rate_hz, f"{where}: rate_hz")
    units, axes = _units(stand), tuple(_axes(known.accelerometers, where))
    # The rows of one table are as many for all its columns.
    row_hz = axes[0].rate_hz if axes and not axes[0].topic else rate_hz
    found = tuple(
        _channel(name, row, units, row_hz, f"{where}: channels: {name}")
        for name, row in known.channels.items()
    )
    made = SourceMapping(
        where,
        stand.name,
        known.format,
        rate_hz,
        found,
        _time(known.time, f"{where}: time"),
        known.split_by,
        tuple(known.truth.items()),
        axes,
    )
    _check(made)
    return made


def _units(stand: Stand) -> dict[str, str]:
    """Unit of each channel that the description of the stand knows."""
    model = described(stand.actuator)
    return dict(model.units)


def _channel(
    name: str, row: ChannelRow, units: Mapping[str, str], rate_hz: float, where: str
) -> ChannelMapping:
    if name not in units:
        known = ", ".join(units)
        raise ConfigurationError(
            f"{where}: {shown(name)} is no sensor or input of the description, known are {known}"
        )
    to_si = conversion_to(row.unit, units[name], f"{where}: unit")
    source_hz = rate_hz if math.isnan(row.rate_hz) else row.rate_hz
    age_s = AGE_READINGS / source_hz if math.isnan(row.age_s) else row.age_s
    if age_s < 1.0 / source_hz:
        raise ConfigurationError(
            f"{where}: age_s = {age_s!r} is less than the {1.0 / source_hz:g} s between readings; "
            "raise it, or every reading is stale"
        )
    low, high = row.range
    if not low < high:
        raise ConfigurationError(
            f"{where}: range = {shown(row.range)}: the first must be below the second"
        )
    return ChannelMapping(
        name,
        to_si.unit,
        _terms(row, where),
        to_si.factor * row.scale * _sign(row.sign, f"{where}: sign"),
        to_si.factor * row.offset + to_si.offset,
        low,
        high,
        source_hz,
        row.resample,
        age_s,
        row.unit,
        row.serial,
        row.mount,
        row.sampling,
        row.note,
        row.turn,
    )


def _axes(rows: Mapping[str, AccelerometerRow], where: str) -> Iterator[AxisMapping]:
    """Every axis of the accelerometers, all of one rate."""
    rates = sorted({row.rate_hz for row in rows.values()})
    if len(rates) > 1:
        raise ConfigurationError(
            f"{where}: accelerometers: rates of {rates[0]:g} and {rates[-1]:g} Hz; they must be "
            "sampled together, so give one"
        )
    for name, row in rows.items():
        here = f"{where}: accelerometers: {name}"
        if not _ACCELEROMETER.fullmatch(name):
            raise ConfigurationError(f"{here} is no name of one; write accelerometer_1")
        to_si = conversion_to(row.unit, "m/s^2", f"{here}: unit")
        low, high = row.range
        if not low < high or not row.axes:
            raise ConfigurationError(
                f"{here}: axes = {shown(dict(row.axes))} and range = {shown(row.range)}: give a "
                "column for each axis, and the lowest reading before the highest"
            )
        message = _message(row.type, here) if row.topic else ""
        points = message == POINT_CLOUD
        for axis, place in row.axes.items():
            path = FieldPath.parsed(place, here) if row.topic and not points else None
            yield AxisMapping(
                f"{name}_{axis}", place, to_si.factor, low, high, row.rate_hz, row.serial,
                row.mount, row.topic, message, path,
            )  # fmt: skip


def _terms(row: ChannelRow, where: str) -> tuple[SourceTerm, ...]:
    """The sum of a channel, or its one place."""
    if not row.sum:
        return (_term(row, 1.0, where),)
    if row.topic or row.type or row.field or row.column:
        raise ConfigurationError(f"{where}: it has a sum and a place of its own; keep one of them")
    made = []
    for number, term in enumerate(row.sum, 1):
        place = f"{where}: sum {number}"
        made.append(_term(term, _sign(term.sign, f"{place}: sign"), place))
    return tuple(made)


def _term(row: PlaceTerm, weight: float, where: str) -> SourceTerm:
    column, topic = row.column, row.topic
    if bool(column) == bool(topic):
        raise ConfigurationError(
            f"{where}: it names {'both a column and a topic' if column else 'no source'}; give "
            "column, or topic with type and field"
        )
    if column:
        return SourceTerm(weight, column=column)
    for key in ("type", "field"):
        if not getattr(row, key):
            example = "sensor_msgs/msg/JointState" if key == "type" else "effort[elbow]"
            raise ConfigurationError(f"{where}: topic {topic} has no {key}; give one, as {example}")
    message, path = _message(row.type, where), FieldPath.parsed(row.field, where)
    return SourceTerm(weight, topic, message, path)


def _message(text: str, where: str) -> str:
    """Full name of a message type."""
    package, *kind, name = text.split("/")
    if not package.isidentifier() or kind not in ([], ["msg"]) or not name.isidentifier():
        raise ConfigurationError(
            f"{where}: type = {shown(text)} is no message type; write it like "
            "sensor_msgs/msg/JointState"
        )
    return f"{package}/msg/{name}"


def _sign(value: int, where: str) -> float:
    if value not in (1, -1):
        raise ConfigurationError(f"{where} = {value} must be 1 or -1; a factor goes into scale")
    return float(value)


def _rate(value: float, where: str) -> float:
    if not SLOWEST_HZ <= value <= FASTEST_HZ:
        said = "is missing" if math.isnan(value) else f"= {value!r} is outside its limits"
        raise ConfigurationError(
            f"{where} {said}: give the rate of the scans, {SLOWEST_HZ:g} to {FASTEST_HZ:g} Hz"
        )
    return value


def _time(known: TimeColumn | None, where: str) -> TableTime:
    if known is None:
        return TableTime(start_ns=_START_NS)
    if known.unit == DATENUM:
        if known.start:
            raise ConfigurationError(f"{where}: start: a datenum says the day itself; leave it out")
        return TableTime(known.column, 86400.0, 0, DATENUM_OF_1970)
    seconds = conversion_to(known.unit, "s", f"{where}: unit")
    start_ns = _moment_ns(known.start, f"{where}: start") if known.start else 0
    return TableTime(known.column, seconds.factor, start_ns)


_START_NS = 946_684_800 * 1_000_000_000
"""2000-01-01, where a table says nothing of time: bags hold times of day."""


def _moment_ns(text: str, where: str) -> int:
    try:
        moment = datetime.fromisoformat(text.replace("Z", "+00:00"))
    except ValueError:
        moment = None
    if moment is None or not 1899 <= moment.year < 2200:
        raise ConfigurationError(
            f"{where} = {shown(text)} is no date and time of 1899 to 2199; write it like "
            "'2017-05-01T10:00:00Z', in quotes"
        )
    if moment.tzinfo is None:
        moment = moment.replace(tzinfo=timezone.utc)
    return round(moment.timestamp() * 1e9)


def _check(made: SourceMapping) -> None:
    """What holds for all channels together."""
    terms = made.terms
    if not terms or len(terms) > MOST_TERMS:
        raise ConfigurationError(
            f"{made.where}: channels has {len(terms)} sources, must be 1 to {MOST_TERMS}"
        )
    topics: dict[str, str] = {}
    for term in terms:
        known = topics.setdefault(term.topic, term.message)
        if known != term.message:
            raise ConfigurationError(
                f"{made.where}: topic {term.topic} is of type {known} in one place and of "
                f"{term.message} in another; it has one type"
            )
    if made.axes and {bool(axis.topic) for axis in made.axes} != {bool(terms[0].topic)}:
        raise ConfigurationError(
            f"{made.where}: accelerometers and channels must both name topics, or both columns"
        )
    if len({axis.topic for axis in made.axes}) > 1:
        raise ConfigurationError(
            f"{made.where}: accelerometers name several topics; samples of one block are of one "
            "message, so give the topic of one, or publish sensors/vibration"
        )
    if len({bool(term.topic) for term in terms}) > 1:
        raise ConfigurationError(
            f"{made.where}: some channels name columns and others topics; a stand has one kind of "
            "recording, make a second folder for the other"
        )
