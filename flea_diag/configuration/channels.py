"""``channels.yaml``: where the channels of a stand come from, read into a ``SourceMapping``."""

from __future__ import annotations

import math
from collections.abc import Mapping
from datetime import datetime, timezone
from typing import Any

from flea_diag.configuration.description import described
from flea_diag.configuration.files import load_yaml
from flea_diag.configuration.stand import STAND_FILE, Stand
from flea_diag.core.schema import REQUIRED, Keys, pairs, read, rows, texts
from flea_diag.core.symbolic.converted_unit import conversion_to
from flea_diag.errors import ConfigurationError, shown
from flea_diag.formats import migrated
from flea_diag.wire.sources.field_path import FieldPath
from flea_diag.wire.sources.mapping import (
    FLEA_TEXT,
    FORMATS,
    RESAMPLINGS,
    ChannelMapping,
    SourceMapping,
    SourceTerm,
    TableTime,
)

KEYS: Keys = {
    "format": (str, FORMATS[0]),
    "rate_hz": (float, math.nan),
    "channels": (dict, {}),
    "time": (dict, {}),
    "split_by": (list, []),
    "truth": (dict, {}),
}
PLACE: Keys = {"topic": (str, ""), "type": (str, ""), "field": (str, ""), "column": (str, "")}
TERM: Keys = {**PLACE, "sign": (int, 1)}
ROW: Keys = {
    **TERM,
    "sum": (list, []),
    "unit": (str, REQUIRED),
    "range": (list, REQUIRED),
    "scale": (float, 1.0),
    "offset": (float, 0.0),
    "rate_hz": (float, math.nan),
    "resample": (str, RESAMPLINGS[0]),
    "age_s": (float, math.nan),
    "serial": (str, ""),
    "mount": (str, ""),
    "sampling": (str, "mean"),
    "note": (str, ""),
}
TIME: Keys = {"column": (str, REQUIRED), "unit": (str, "s"), "start": (str, "")}

SLOWEST_HZ, FASTEST_HZ = 1.0, 1000.0
"""Rates that scans may have."""
MOST_TERMS = 200
AGE_READINGS = 3.0
"""Age limit of a reading by default, in times between two readings."""


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
    values = read(migrated("channel mapping", load_yaml(stand.channels), where), where, KEYS)
    _one_of(values["format"], FORMATS, f"{where}: format")
    if values["format"] == FLEA_TEXT:
        return SourceMapping(where, stand.name, FLEA_TEXT, 100.0, ())
    rate_hz = _rate(values["rate_hz"], f"{where}: rate_hz")
    units = _units(stand)
    listed = rows(values["channels"], f"{where}: channels")
    found = tuple(
        _channel(name, row, units, rate_hz, f"{where}: channels: {name}")
        for name, row in listed.items()
    )
    made = SourceMapping(
        where,
        stand.name,
        values["format"],
        rate_hz,
        found,
        _time(values["time"], f"{where}: time"),
        texts(values["split_by"], f"{where}: split_by"),
        tuple(pairs(values["truth"], f"{where}: truth").items()),
    )
    _check(made)
    return made


def _units(stand: Stand) -> dict[str, str]:
    """Unit of each channel that the description of the stand knows."""
    model = described(stand.actuator)
    return dict(model.units)


def _channel(
    name: str, content: Any, units: Mapping[str, str], rate_hz: float, where: str
) -> ChannelMapping:
    values = read(content, where, ROW)
    if name not in units:
        known = ", ".join(units)
        raise ConfigurationError(
            f"{where}: {shown(name)} is no sensor or input of the description, known are {known}"
        )
    to_si = conversion_to(values["unit"], units[name], f"{where}: unit")
    _one_of(values["resample"], RESAMPLINGS, f"{where}: resample")
    scale = _scale(values["scale"], f"{where}: scale")
    source_hz = values["rate_hz"] if math.isfinite(values["rate_hz"]) else rate_hz
    if not 0.0 < source_hz <= 1e6:
        raise ConfigurationError(f"{where}: rate_hz = {source_hz!r} must be above 0, up to 1e6")
    age_s = values["age_s"] if math.isfinite(values["age_s"]) else AGE_READINGS / source_hz
    if age_s < 1.0 / source_hz:
        raise ConfigurationError(
            f"{where}: age_s = {age_s!r} is less than the {1.0 / source_hz:g} s between readings; "
            "raise it, or every reading is stale"
        )
    sign = _sign(values["sign"], f"{where}: sign")
    low, high = _range(values["range"], f"{where}: range")
    return ChannelMapping(
        name,
        to_si.unit,
        _terms(values, where),
        to_si.factor * scale * sign,
        to_si.factor * values["offset"] + to_si.offset,
        low,
        high,
        source_hz,
        values["resample"],
        age_s,
        values["unit"],
        values["serial"],
        values["mount"],
        values["sampling"],
        values["note"],
    )


def _terms(values: Mapping[str, Any], where: str) -> tuple[SourceTerm, ...]:
    """The sum of a channel, or its one place."""
    if not values["sum"]:
        return (_term(values, 1.0, where),)
    if any(values[key] for key in PLACE):
        raise ConfigurationError(f"{where}: it has a sum and a place of its own; keep one of them")
    made = []
    for number, part in enumerate(values["sum"], 1):
        place = f"{where}: sum {number}"
        term = read(part, place, TERM)
        made.append(_term(term, _sign(term["sign"], f"{place}: sign"), place))
    return tuple(made)


def _term(values: Mapping[str, Any], weight: float, where: str) -> SourceTerm:
    column, topic = values["column"], values["topic"]
    if bool(column) == bool(topic):
        raise ConfigurationError(
            f"{where}: it names {'both a column and a topic' if column else 'no source'}; give "
            "column, or topic with type and field"
        )
    if column:
        return SourceTerm(weight, column=column)
    for key in ("type", "field"):
        if not values[key]:
            example = "sensor_msgs/msg/JointState" if key == "type" else "effort[elbow]"
            raise ConfigurationError(f"{where}: topic {topic} has no {key}; give one, as {example}")
    package, *kind, name = values["type"].split("/")
    if not package.isidentifier() or kind not in ([], ["msg"]) or not name.isidentifier():
        raise ConfigurationError(
            f"{where}: type = {shown(values['type'])} is no message type; write it like "
            "sensor_msgs/msg/JointState"
        )
    path = FieldPath.parsed(values["field"], where)
    return SourceTerm(weight, topic, f"{package}/msg/{name}", path)


def _sign(value: int, where: str) -> float:
    if value not in (1, -1):
        raise ConfigurationError(f"{where} = {value} must be 1 or -1; a factor goes into scale")
    return float(value)


def _scale(value: float, where: str) -> float:
    if value <= 0.0:
        raise ConfigurationError(f"{where} = {value!r} must be above 0; a sign goes into sign")
    return value


def _range(values: Any, where: str) -> tuple[float, float]:
    """Limits in SI, whatever the unit of the readings: so a wrong unit shows."""
    if len(values) != 2:
        raise ConfigurationError(f"{where} = {shown(values)} must be [lowest, highest reading]")
    ends = read(dict(zip(("low", "high"), values, strict=True)), where, _ENDS)
    if not ends["low"] < ends["high"]:
        raise ConfigurationError(f"{where} = {shown(values)}: the first must be below the second")
    return ends["low"], ends["high"]


_ENDS: Keys = {"low": (float, REQUIRED), "high": (float, REQUIRED)}


def _rate(value: float, where: str) -> float:
    if not SLOWEST_HZ <= value <= FASTEST_HZ:
        said = "is missing" if math.isnan(value) else f"= {value!r} is outside its limits"
        raise ConfigurationError(
            f"{where} {said}: give the rate of the scans, {SLOWEST_HZ:g} to {FASTEST_HZ:g} Hz"
        )
    return value


def _one_of(value: str, known: tuple[str, ...], where: str) -> None:
    if value not in known:
        raise ConfigurationError(
            f"{where} = {shown(value)} is unknown, choose {' or '.join(known)}"
        )


def _time(content: Any, where: str) -> TableTime:
    if not content:
        return TableTime(start_ns=_START_NS)
    values = read(content, where, TIME)
    seconds = conversion_to(values["unit"], "s", f"{where}: unit")
    start_ns = _moment_ns(values["start"], f"{where}: start") if values["start"] else 0
    return TableTime(values["column"], seconds.factor, start_ns)


_START_NS = 946_684_800 * 1_000_000_000
"""2000-01-01, where a table says nothing of time: bags hold times of day."""


def _moment_ns(text: str, where: str) -> int:
    try:
        moment = datetime.fromisoformat(text.replace("Z", "+00:00"))
    except ValueError:
        moment = None
    if moment is None or not 1970 < moment.year < 2200:
        raise ConfigurationError(
            f"{where} = {shown(text)} is no date and time of 1971 to 2199; write it like "
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
    if len({bool(term.topic) for term in terms}) > 1:
        raise ConfigurationError(
            f"{made.where}: some channels name columns and others topics; a stand has one kind of "
            "recording, make a second folder for the other"
        )
