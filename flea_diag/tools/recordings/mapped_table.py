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

"""Recordings in tables, by the columns that the mapping of a stand names."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import numpy.typing as npt

from flea_diag.errors import RecordingError
from flea_diag.tools.recordings.mapped_recording import MappedRecording, checked
from flea_diag.tools.recordings.source_checks import check_rate
from flea_diag.tools.recordings.vibration_columns import vibration_blocks
from flea_diag.tools.tables.readers import read_table, stem_of
from flea_diag.tools.tables.row_order import row_order
from flea_diag.tools.tables.table import Array, NoColumnError
from flea_diag.wire.sources.mapping import ChannelMapping, SourceMapping
from flea_diag.wire.sources.scan_grid import ScanGrid

Columns = dict[str, Array]
MOST_BAGS = 10_000
"""Bags that one file may be split into."""
_EPOCH_NS = 100_000_000 * 1_000_000_000
"""1973: times before it are no times of day."""


def of_table(path: Path, mapping: SourceMapping) -> Iterator[MappedRecording]:
    """Recordings of a table: as many as ``split_by`` tells apart, or as its times begin anew.

    Raises
    ------
    RecordingError
        It lacks what the mapping names, or what it holds contradicts the mapping.
    """
    columns = [term.column for term in mapping.terms if term.column]
    if not columns:
        raise RecordingError(f"{path} is a table, {mapping.where} names topics: name a bag")
    time = [mapping.time.column] if mapping.time.column else []
    try:
        axes = [axis.column for axis in mapping.axes]
        read = read_table(path, [*time, *columns, *axes, *mapping.split_by])
    except NoColumnError as error:
        raise RecordingError(f"{error}; correct {_user_of(error.name, mapping)}") from None
    notes = tuple(f"{path}: {note}" for note in read.notes)
    table = dict(read.columns)
    for name, rows in _parts(path, table, mapping):
        part = {key: values[rows] for key, values in table.items()}
        where = f"{path}: {name}" if mapping.split_by else str(path)
        for each in _of_rows(where, name, part, mapping):
            yield replace(each, warnings=(*notes, *each.warnings))
            notes = ()


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


def _of_rows(
    where: str, name: str, part: Columns, mapping: SourceMapping
) -> Iterator[MappedRecording]:
    """Recordings of some rows, cut where their times begin anew."""
    time = mapping.time
    if not time.column:
        count = len(next(iter(part.values())))
        stamps = time.start_ns + np.arange(count, dtype=np.int64) * mapping.row_period_ns
        yield _of_stamped(where, name, part, stamps, mapping)
        return
    column = part[time.column] - time.zero
    seconds = column * time.factor
    order = row_order(where, time.column, seconds, part)
    stamps = _stamps(where, column, order.seconds - seconds, mapping)
    said = tuple(f"{where}: {note}" for note in order.notes)
    for number, rows in enumerate(order.parts, 1):
        several = len(order.parts) > 1
        own = {key: values[rows] for key, values in part.items()}
        made = _of_stamped(
            f"{where}: recording {number}" if several else where,
            f"{name}_{number}" if several else name, own, stamps[rows], mapping,
        )  # fmt: skip
        yield replace(made, warnings=(*said, *made.warnings))
        said = ()


def _of_stamped(
    where: str, name: str, part: Columns, stamps: npt.NDArray[np.int64], mapping: SourceMapping
) -> MappedRecording:
    columns = np.column_stack([part[term.column] for term in mapping.terms])
    grid, scans = ScanGrid(mapping), []
    for stamp_ns, row in zip(stamps.tolist(), columns.tolist(), strict=True):
        scans += grid.push(stamp_ns, enumerate(row))
    scans += grid.finish()
    notes = _rates(where, part, stamps, mapping)
    made = checked(where, name, mapping, scans, grid, notes)
    return replace(made, vibration=vibration_blocks(where, mapping, stamps, part))


def _rates(
    where: str, part: Columns, stamps: npt.NDArray[np.int64], mapping: SourceMapping
) -> list[str]:
    """What is odd about the rates of the channels, each by the rows in which it was read."""
    alike: dict[tuple[float, bytes], list[ChannelMapping]] = {}
    rows: dict[tuple[float, bytes], npt.NDArray[np.bool_]] = {}
    for row in mapping.channels:
        read = np.isfinite(np.column_stack([part[term.column] for term in row.terms])).all(axis=1)
        key = row.rate_hz, read.tobytes()
        alike.setdefault(key, []).append(row)
        rows[key] = read
    found = (check_rate(where, mapping, alike[key], stamps[rows[key]]) for key in alike)
    return [words for words in found if words]


def _stamps(
    where: str, column: Array, moved_s: Array, mapping: SourceMapping
) -> npt.NDArray[np.int64]:
    """Stamps of the rows in ns, by the column of times and what a coarse clock lacks."""
    time = mapping.time
    finite = np.isfinite(column)
    if np.abs(column[finite]).max() * time.factor > 5e9:
        raise RecordingError(
            f"{where}: {time.column} = {np.abs(column[finite]).max():g} is no time before 2128; "
            "give its unit under time (s, ms, us or ns)"
        )
    known = np.where(finite, column, 0.0)
    whole = np.floor(known)
    seconds = np.round(whole * (time.factor * 1e9)) + np.round((known - whole) * time.factor * 1e9)
    moved_ns = np.round(1e9 * np.where(finite, moved_s, 0.0)).astype(np.int64)
    stamps = time.start_ns + seconds.astype(np.int64) + moved_ns
    if stamps[finite][0] < _EPOCH_NS:
        raise RecordingError(
            f"{where}: {time.column} begins at {column[finite][0]:g}, which is no time of day: "
            "give its start under time, for example start: '2017-05-01T10:00:00Z'"
        )
    return np.asarray(stamps)
