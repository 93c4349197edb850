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

"""Series of numbers in a bag: every field that a sensor could fill, by its own stamps."""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from flea_diag.errors import ConfigurationError, RecordingError, WireError
from flea_diag.tools.recordings.bag_clocks import received_topics
from flea_diag.tools.recordings.second_publisher import second_publisher
from flea_diag.tools.recordings.senders import Senders, Signature
from flea_diag.tools.series.recorded_series import RecordedSeries, Series
from flea_diag.wire.bags.foreign_bag import ForeignBag
from flea_diag.wire.sources.field_path import FieldPath, fields_of
from flea_diag.wire.sources.message_terms import stamp_of

Array = npt.NDArray[np.float64]

MOST_CELLS = 5_000_000
"""Numbers that are read of a bag: its beginning will do."""
MOST_FIELDS = 200
MOST_ELEMENTS = 32
"""Elements of an array that are looked at: a longer one is a waveform, an image or a map."""
DEEPEST = 5
NO_READINGS = ("header", "stamp", "seq", "covariance", "variance", "level")
"""Fields of messages that no sensor fills; nor does one in capitals, which is a constant."""
NO_SENSORS = frozenset({
    "PointCloud2", "Image", "CompressedImage", "LaserScan", "OccupancyGrid", "TFMessage", "Log",
    "Clock", "ParameterEvent", "CameraInfo", "MarkerArray", "Marker", "Path", "MetricsMessage",
    "Statistics", "NavSatFix", "MapMetaData",
})  # fmt: skip
"""Types of messages that hold no readings of an actuator."""
_TIMES = ({"sec", "nanosec"}, {"secs", "nsecs"}, {"sec", "nsec"})
_QUATERNION = {"x", "y", "z", "w"}
FEWEST_READINGS = 10


@dataclass
class _TopicRead:
    """Messages of one topic as they are read."""

    places: list[FieldPath]
    stamps: list[int] = field(default_factory=list)
    logs: list[int] = field(default_factory=list)
    senders: list[Signature | None] = field(default_factory=list)
    values: list[list[float]] = field(default_factory=list)


def recorded_bag(path: Path) -> RecordedSeries:
    """All series of a bag, up to ``MOST_CELLS`` numbers."""
    bag = ForeignBag(path)
    topics: dict[str, _TopicRead] = {}
    senders, cells = Senders(), 0
    unread = bag.unreadable()
    if bag.topics and not set(bag.topics) - unread.keys():
        raise RecordingError(next(iter(unread.values())))
    for topic, log_ns, content in bag.messages([t for t in bag.topics if t not in unread]):
        known = topics.get(topic)
        if known is None:
            kind = bag.topics[topic].rpartition("/")[2]
            places = [] if kind in NO_SENSORS else _places(content)
            known = topics[topic] = _TopicRead(places)
        elif len(known.values) < FEWEST_READINGS and known.places:
            _add_places(known, content)
        if known.places:
            known.stamps.append(stamp_of(content, log_ns))
            known.logs.append(log_ns)
            known.senders.append(senders.add(f"/{topic}", content))
            known.values.append([_read(place, content) for place in known.places])
        cells += 1 + len(known.places)
        if cells > MOST_CELLS:
            break
    return _recorded(path, bag, topics, senders)


def _recorded(
    path: Path, bag: ForeignBag, topics: dict[str, _TopicRead], senders: Senders
) -> RecordedSeries:
    read = {name: each for name, each in topics.items() if len(each.values) >= FEWEST_READINGS}
    received, notes = received_topics(
        {f"/{name}": each.stamps for name, each in read.items()},
        {f"/{name}": each.logs for name, each in read.items()},
    )
    start_ns = min(
        (min(received.get(f"/{n}", each.stamps)) for n, each in read.items()),
        default=0,
    )
    series = []
    for name, each in read.items():
        topic = f"/{name}"
        out = senders.left_out(topic)
        kept = np.array([sender not in out for sender in each.senders])
        stamps = received.get(topic, each.stamps)
        times_s = (np.array(stamps, dtype=np.int64) - start_ns)[kept] * 1e-9
        width = len(each.places)
        table = np.array([row + [np.nan] * (width - len(row)) for row in each.values])[kept]
        try:
            other = second_publisher(times_s, _moving(table))
        except RecordingError as error:
            raise RecordingError(f"{path}: {topic}: {error}") from None
        if other.any():
            notes += (
                f"{topic}: {int(other.sum())} of {len(other)} messages jump away and back in all "
                "fields, at a rate of their own: a second publisher, left out",
            )
            times_s, table = times_s[~other], table[~other]
        for place, column in zip(each.places, table.T, strict=True):
            named = {"topic": topic, "type": bag.topics[name], "field": place.text}
            series.append(Series(named, np.asarray(times_s, dtype=np.float64), column))
        notes += senders.notes(topic)
    silent = tuple(
        f"/{name} ({bag.topics[name]})"
        for name in bag.topics
        if name not in read or not read[name].places
    )
    return RecordedSeries(path, False, tuple(series), silent, (*bag.losses[:3], *notes))


def _moving(table: Array) -> Array:
    """Columns that change."""
    return table[:, [len(np.unique(column[np.isfinite(column)])) > 2 for column in table.T]]


def _add_places(known: _TopicRead, content: Any) -> None:
    """Elements that another sender names."""
    have = {place.text for place in known.places}
    known.places += [place for place in _places(content) if place.text not in have]


def _read(place: FieldPath, message: Any) -> float:
    try:
        value = place.read(message)
    except WireError:
        return float("nan")
    return float("nan") if value is None else value


def _places(message: Any) -> list[FieldPath]:
    """Paths of all numbers in a message."""
    found = []
    for text in itertools.islice(_paths(message, "", 0, message), MOST_FIELDS):
        try:
            path = FieldPath.parsed(text, "")
            if path.read(message) is not None:
                found.append(path)
        except (ConfigurationError, WireError):
            continue
    return found


def _paths(message: Any, prefix: str, depth: int, root: Any) -> Iterator[str]:
    fields = fields_of(message)
    if set(fields) in _TIMES or set(fields) == _QUATERNION:
        return
    for name in fields:
        unread = name in NO_READINGS or name.isupper() or name.endswith("covariance")
        if unread or depth > DEEPEST:
            continue
        yield from _paths_of(getattr(message, name), f"{prefix}{name}", depth, root)


def _paths_of(value: Any, path: str, depth: int, root: Any) -> Iterator[str]:
    if isinstance(value, str):
        if _is_number(value):
            yield path
    elif hasattr(value, "__len__"):
        if 0 < len(value) <= MOST_ELEMENTS and not isinstance(value[0], str):
            for key, element in zip(_keys(path, value, root), value, strict=False):
                yield from _paths_of(element, f"{path}[{key}]", depth + 1, root)
    elif isinstance(value, int | float | np.number) and not isinstance(value, bool):
        yield path
    else:
        yield from _paths(value, f"{path}.", depth + 1, root)


def _keys(path: str, value: Any, root: Any) -> Iterable[object]:
    """Names of the elements of an array, or their numbers."""
    try:
        names = FieldPath.parsed(f"{path}[0]", "").names_in(root)
    except (ConfigurationError, WireError):
        names = ()
    return names if len(set(names)) == len(value) else range(len(value))


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True
