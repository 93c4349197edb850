"""Every series of numbers in a recording, with the place that a channel mapping names it by."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from flea_diag.core.calibration.power_balance import LARGEST
from flea_diag.errors import ConfigurationError, RecordingError, WireError
from flea_diag.tools.recordings.table import header_of, read_table, suffix_of
from flea_diag.wire.bags.foreign_bag import ForeignBag
from flea_diag.wire.sources.field_path import FieldPath, fields_of
from flea_diag.wire.sources.message_terms import stamp_of

Array = npt.NDArray[np.float64]

MOST_SERIES = 200
MOST_CELLS = 5_000_000
"""Numbers that are read of a bag: its beginning will do."""
MOST_ELEMENTS = 32
"""Elements of an array that are looked at: a longer one is a waveform, an image or a map."""
DEEPEST = 5
NO_READINGS = ("header", "stamp", "seq", "covariance", "variance", "level")
"""Fields of messages that no sensor fills; nor does one in capitals, which is a constant."""
WAVEFORMS = ("PointCloud2", "Image", "CompressedImage", "LaserScan", "OccupancyGrid", "TFMessage")
FEWEST_READINGS = 10


@dataclass(frozen=True, eq=False)
class Series:
    """One column of a table, or one field of a topic.

    Parameters
    ----------
    place
        Keys of a channel in channels.yaml: ``column``, or ``topic``, ``type`` and ``field``.
    times_s, values
        Shape (n,) each; NaN where a message or row has no value.
    """

    place: Mapping[str, str]
    times_s: Array
    values: Array

    @property
    def words(self) -> str:
        """The place as people name it."""
        if "column" in self.place:
            return self.place["column"]
        return f"{self.place['topic']} {self.place['field']}"

    @property
    def rate_hz(self) -> float:
        """Readings a second; NaN for fewer than three."""
        steps = np.diff(self.times_s)
        steps = steps[steps > 0.0]
        return 1.0 / float(np.median(steps)) if len(steps) > 1 else math.nan

    @property
    def readings(self) -> Array:
        """Readings that a sensor can have: NaN elsewhere."""
        return np.where(np.abs(self.values) < LARGEST, self.values, np.nan)

    @property
    def changes(self) -> bool:
        """Whether it has two readings that differ."""
        finite = self.readings[np.isfinite(self.readings)]
        return len(finite) > 1 and float(finite.min()) < float(finite.max())


@dataclass(frozen=True, eq=False)
class RecordedSeries:
    """What a recording holds; ``silent`` topics hold no numbers that a channel could be."""

    path: Path
    is_table: bool
    series: tuple[Series, ...]
    silent: tuple[str, ...] = ()


def recorded_series(path: Path) -> RecordedSeries:
    """Read all series of a table or bag.

    Raises
    ------
    RecordingError
        It cannot be read, or holds no series of numbers.
    """
    found = _of_table(path) if suffix_of(path) else _of_bag(path)
    if not found.series:
        has = ", ".join(found.silent[:20]) or "nothing"
        raise RecordingError(f"{path} holds no series of numbers to make channels of, only {has}")
    return found


def _of_table(path: Path) -> RecordedSeries:
    names = [name for name in header_of(path) if name]
    if names and all(_is_number(name) for name in names):
        raise RecordingError(
            f"{path}: its first line is {', '.join(names[:4])}: name the columns there"
        )
    if len(names) > MOST_SERIES:
        raise RecordingError(f"{path} has {len(names)} columns, at most {MOST_SERIES} are read")
    columns = _numeric(path, names)
    count = len(next(iter(columns.values()), ()))
    rows = np.arange(count, dtype=np.float64)
    series = tuple(Series({"column": name}, rows, values) for name, values in columns.items())
    return RecordedSeries(path, True, series, tuple(n for n in names if n not in columns))


def _numeric(path: Path, names: list[str]) -> dict[str, Array]:
    """Columns of numbers; those of texts are left out."""
    once = [name for name in names if names.count(name) == 1]
    try:
        return read_table(path, once) if once else {}
    except RecordingError:
        found: dict[str, Array] = {}
        for name in once:
            try:
                found |= read_table(path, [name])
            except RecordingError:
                continue
        return found


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True


def _of_bag(path: Path) -> RecordedSeries:
    bag = ForeignBag(path)
    places: dict[str, list[FieldPath]] = {}
    stamps: dict[str, list[int]] = {}
    values: dict[str, list[list[float]]] = {}
    cells = 0
    for topic, log_ns, content in bag.messages(bag.topics):
        if topic not in places:
            kind = bag.topics[topic].rpartition("/")[2]
            places[topic] = [] if kind in WAVEFORMS else _places(content)
            stamps[topic], values[topic] = [], []
        if places[topic]:
            stamps[topic].append(stamp_of(content, log_ns))
            values[topic].append([_read(place, content) for place in places[topic]])
        cells += 1 + len(places[topic])
        if cells > MOST_CELLS:
            break
    start_ns = min((min(each) for each in stamps.values() if each), default=0)
    series = []
    for topic, read in values.items():
        if len(read) < FEWEST_READINGS:
            places[topic] = []
            continue
        times_s = (np.array(stamps[topic], dtype=np.int64) - start_ns) * 1e-9
        table = np.array(read, dtype=np.float64).reshape(len(times_s), -1)
        for place, column in zip(places[topic], table.T, strict=True):
            named = {"topic": f"/{topic}", "type": bag.topics[topic], "field": place.text}
            series.append(Series(named, np.asarray(times_s, dtype=np.float64), column))
    silent = tuple(
        f"/{topic} ({bag.topics[topic]})" for topic in bag.topics if not places.get(topic)
    )
    return RecordedSeries(path, False, tuple(series[:MOST_SERIES]), silent)


def _read(place: FieldPath, message: Any) -> float:
    try:
        value = place.read(message)
    except WireError:
        return math.nan
    return math.nan if value is None else value


def _places(message: Any) -> list[FieldPath]:
    """Paths of all numbers in a message."""
    found = []
    for text in itertools.islice(_paths(message, "", 0), MOST_SERIES):
        try:
            path = FieldPath.parsed(text, "")
            if path.read(message) is not None:
                found.append(path)
        except (ConfigurationError, WireError):
            continue
    return found


def _paths(message: Any, prefix: str, depth: int) -> Iterator[str]:
    for name in fields_of(message):
        unread = name in NO_READINGS or name.isupper() or name.endswith("covariance")
        if unread or depth > DEEPEST:
            continue
        yield from _paths_of(message, getattr(message, name), f"{prefix}{name}", depth)


def _paths_of(message: Any, value: Any, path: str, depth: int) -> Iterator[str]:
    if isinstance(value, str):
        if _is_number(value):
            yield path
    elif hasattr(value, "__len__"):
        if 0 < len(value) <= MOST_ELEMENTS and not isinstance(value[0], str):
            names = FieldPath(path, ((path.rpartition(".")[2], "0"),)).names_in(message)
            keys = names if len(set(names)) == len(value) else range(len(value))
            for key, element in zip(keys, value, strict=False):
                yield from _paths_of(element, element, f"{path}[{key}]", depth + 1)
    elif isinstance(value, int | float | np.number) and not isinstance(value, bool):
        yield path
    else:
        yield from _paths(value, f"{path}.", depth + 1)
