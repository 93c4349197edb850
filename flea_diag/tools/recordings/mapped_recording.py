"""Recordings of any make as records, by the mapping of their stand."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import numpy.typing as npt

from flea_diag.errors import RecordingError, WireError, shown
from flea_diag.tools.recordings.source_checks import check_ranges, check_rate, check_signs
from flea_diag.tools.recordings.table import (
    Columns,
    NoColumnError,
    read_table,
    stem_of,
    suffix_of,
)
from flea_diag.tools.recordings.vibration_columns import vibration_blocks
from flea_diag.wire.bags.foreign_bag import ForeignBag
from flea_diag.wire.records import NEVER_NS, ChannelTable, Scan, Truth, VibrationBlock
from flea_diag.wire.sources.mapping import SourceMapping
from flea_diag.wire.sources.message_terms import MessageTerms, stamp_of
from flea_diag.wire.sources.scan_grid import ScanGrid

MOST_BAGS = 10_000
"""Bags that one file may be split into."""
MOST_SCANS = 5_000_000
_EPOCH_NS = 100_000_000 * 1_000_000_000
"""1973: times before it are no times of day."""


@dataclass(frozen=True)
class MappedRecording:
    """One recording ready to be written; ``warnings`` are lines for people."""

    name: str
    mapping: SourceMapping
    made: tuple[Scan, ...]
    warnings: tuple[str, ...] = ()
    vibration: tuple[VibrationBlock, ...] = ()

    def channel_table(self) -> ChannelTable:
        """Units, ranges and rates."""
        return self.mapping.channel_table(self.made[0].stamp_ns)

    def truth(self) -> Truth | None:
        """The fault that the mapping knows of recordings of this name, from the start."""
        fault = self.mapping.fault_of(self.name)
        if fault is None:
            return None
        start_ns = self.made[0].stamp_ns
        onset_ns = NEVER_NS if fault == "nominal" else start_ns
        return Truth(start_ns, fault, onset_ns, (("run", self.name),))

    def scans(self) -> tuple[Scan, ...]:
        """Every scan, in order."""
        return self.made


def mapped_recordings(path: Path, mapping: SourceMapping) -> Iterator[MappedRecording]:
    """Recordings of a file or bag: of a table as many as it is split into.

    Raises
    ------
    RecordingError
        It lacks what the mapping names, or what it holds contradicts the mapping.
    """
    if suffix_of(path):
        yield from _of_table(path, mapping)
    else:
        yield _of_bag(path, mapping)


# --- tables ----------------------------------------------------------------------------------


def _of_table(path: Path, mapping: SourceMapping) -> Iterator[MappedRecording]:
    columns = [term.column for term in mapping.terms if term.column]
    if not columns:
        raise RecordingError(f"{path} is a table, {mapping.where} names topics: name a bag")
    time = [mapping.time.column] if mapping.time.column else []
    try:
        axes = [axis.column for axis in mapping.axes]
        table = read_table(path, [*time, *columns, *axes, *mapping.split_by])
    except NoColumnError as error:
        raise RecordingError(f"{error}; correct {_user_of(error.name, mapping)}") from None
    for name, rows in _parts(path, table, mapping):
        part = {key: values[rows] for key, values in table.items()}
        yield _of_rows(f"{path}: {name}" if mapping.split_by else str(path), name, part, mapping)


def _user_of(column: str, mapping: SourceMapping) -> str:
    """The line of the mapping that names a column."""
    for row in mapping.channels:
        if any(term.column == column for term in row.terms):
            return f"the column of {row.channel} in {mapping.where}"
    for axis in mapping.axes:
        if axis.column == column:
            return f"the column of {axis.channel} in {mapping.where}"
    return f"{'time' if column == mapping.time.column else 'split_by'} in {mapping.where}"


def _parts(path: Path, table: Columns, mapping: SourceMapping) -> Iterator[tuple[str, slice]]:
    """Name and rows of each recording: a new one begins where a column of ``split_by`` changes."""
    count = len(next(iter(table.values())))
    if not mapping.split_by:
        yield stem_of(path), slice(0, count)
        return
    keys = np.column_stack([table[name] for name in mapping.split_by])
    starts = [0, *(np.flatnonzero((keys[1:] != keys[:-1]).any(axis=1)) + 1).tolist(), count]
    if len(starts) > MOST_BAGS:
        raise RecordingError(
            f"{path}: {', '.join(mapping.split_by)} change {len(starts) - 2} times, at most "
            f"{MOST_BAGS} bags are made of a file: split_by names no readings"
        )
    seen: set[str] = set()
    for start, end in pairwise(starts):
        name = "_".join([stem_of(path), *(f"{value:g}" for value in keys[start])])
        if name in seen:
            raise RecordingError(
                f"{path}: {name} occurs twice: rows of one {', '.join(mapping.split_by)} must "
                "follow one another; sort the file, or name one more column in split_by"
            )
        seen.add(name)
        yield name, slice(start, end)


def _of_rows(where: str, name: str, part: Columns, mapping: SourceMapping) -> MappedRecording:
    stamps = _stamps(where, part, mapping)
    columns = np.column_stack([part[term.column] for term in mapping.terms])
    grid, scans = ScanGrid(mapping), []
    for stamp_ns, row in zip(stamps.tolist(), columns.tolist(), strict=True):
        scans += grid.push(stamp_ns, enumerate(row))
    scans += grid.finish()
    for rate_hz in {row.rate_hz for row in mapping.channels}:
        rows = [row for row in mapping.channels if row.rate_hz == rate_hz]
        check_rate(where, mapping, rows, stamps)
    made = _checked(where, name, mapping, scans, grid)
    return replace(made, vibration=vibration_blocks(where, mapping, stamps, part))


def _stamps(where: str, part: Columns, mapping: SourceMapping) -> npt.NDArray[np.int64]:
    """Stamps of the rows in ns."""
    time = mapping.time
    if not time.column:
        count = len(next(iter(part.values())))
        return time.start_ns + np.arange(count, dtype=np.int64) * mapping.row_period_ns
    column = part[time.column]
    if not np.isfinite(column).all():
        row = int(np.flatnonzero(~np.isfinite(column))[0])
        raise RecordingError(f"{where}: row {row + 1} has no {time.column}; every row needs a time")
    if np.abs(column).max() * time.factor > 5e9:
        raise RecordingError(
            f"{where}: {time.column} = {np.abs(column).max():g} is no time before 2128; give its "
            "unit under time (s, ms, us or ns)"
        )
    whole = np.floor(column)
    seconds = np.round(whole * (time.factor * 1e9)) + np.round((column - whole) * time.factor * 1e9)
    stamps = time.start_ns + seconds.astype(np.int64)
    if stamps[0] < _EPOCH_NS:
        raise RecordingError(
            f"{where}: {time.column} begins at {column[0]:g}, which is no time of day: give its "
            "start under time, for example start: '2017-05-01T10:00:00Z'"
        )
    return np.asarray(stamps)


# --- bags ------------------------------------------------------------------------------------


def _of_bag(path: Path, mapping: SourceMapping) -> MappedRecording:
    wanted = mapping.topics
    if "" in wanted or not wanted:
        raise RecordingError(f"{path} is a bag, {mapping.where} names columns: name a table")
    bag = ForeignBag(path)
    for topic, kind in wanted.items():
        _check_topic(path, topic, kind, bag.topics, mapping)
    terms, grid = MessageTerms(mapping), ScanGrid(mapping)
    scans: list[Scan] = []
    stamps: dict[str, list[int]] = {topic: [] for topic in wanted}
    last: dict[str, object] = {}
    written = {topic.lstrip("/"): topic for topic in wanted}
    for plain, log_ns, content in bag.messages(written):
        topic = written[plain]
        stamp_ns = stamp_of(content, log_ns)
        try:
            values = terms.read(topic, content)
        except WireError as error:
            raise RecordingError(
                f"{path}: {topic}: {error}; correct its field in {mapping.where}"
            ) from error
        last[topic] = content
        if values:
            stamps[topic].append(stamp_ns)
            scans += grid.push(stamp_ns, values)
        if len(scans) > MOST_SCANS:
            raise RecordingError(f"{path}: more than {MOST_SCANS} scans; split the bag")
    scans += grid.finish()
    _check_found(path, mapping, terms, last)
    for row in mapping.channels:
        topic = row.terms[0].topic
        check_rate(f"{path}: {topic}", mapping, [row], np.array(stamps[topic]))
    made = _checked(str(path), path.name.removesuffix(path.suffix), mapping, scans, grid)
    return replace(made, warnings=(*bag.losses[:3], *made.warnings))


def _check_topic(
    path: Path, topic: str, kind: str, known: dict[str, str], mapping: SourceMapping
) -> None:
    channel = next(r.channel for r in mapping.channels for t in r.terms if t.topic == topic)
    name = topic.lstrip("/")
    if name not in known:
        has = ", ".join(f"{has} ({known[has]})" for has in sorted(known)[:20])
        raise RecordingError(
            f"{path} has no topic {topic}, the source of {channel} in {mapping.where}; it has "
            f"{has or 'none'}"
        )
    if known[name] != kind:
        raise RecordingError(
            f"{path}: {topic} is of type {shown(known[name])[1:-1]}, {mapping.where} says {kind}; "
            "correct the type there"
        )


def _check_found(
    path: Path, mapping: SourceMapping, terms: MessageTerms, last: dict[str, object]
) -> None:
    """Every place that the mapping names was there at least once."""
    for number, term in enumerate(mapping.terms):
        if number in terms.found or term.path is None:
            continue
        if term.topic not in last:
            raise RecordingError(f"{path}: {term.topic} has no messages; record it again")
        names = term.path.names_in(last[term.topic])
        has = f"its elements are {', '.join(names[:20])}" if names else "it has too few elements"
        raise RecordingError(
            f"{path}: {term.topic} has no element {term.path}: {has}; correct the field in "
            f"{mapping.where}"
        )


def _checked(
    where: str, name: str, mapping: SourceMapping, scans: list[Scan], grid: ScanGrid
) -> MappedRecording:
    if not scans:
        raise RecordingError(f"{where}: no readings")
    check_ranges(where, mapping, scans)
    check_signs(where, mapping, scans)
    counts = {key: count for key, count in grid.counts.items() if count}
    said = ", ".join(f"{count} {key}" for key, count in counts.items())
    warnings = (f"{where}: readings with odd stamps: {said}",) if said else ()
    return MappedRecording(name, mapping, tuple(scans), warnings)
