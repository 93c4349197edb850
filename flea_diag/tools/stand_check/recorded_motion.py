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

"""Recordings of a stand as readings of its channels, whatever they were recorded with."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt

from flea_diag.configuration.channels import channel_sources
from flea_diag.configuration.stand import Stand
from flea_diag.errors import RecordingError
from flea_diag.tools.recordings.mapped_source import mapped_recordings
from flea_diag.tools.recordings.raw_recordings import FLEA_SUFFIX, is_bag_of_ours
from flea_diag.wire.bags.bag import read_bag
from flea_diag.wire.records import ChannelInfo, ChannelTable, Scan
from flea_diag.wire.sources.mapping import MAPPED, SourceMapping

Array = npt.NDArray[np.float64]
FEWEST = 100
"""Scans of a recording that says anything of a motion."""


@dataclass(frozen=True)
class RecordedMotion:
    """Readings in SI, shape (scans, channels), in the order of ``channels``; NaN: none."""

    name: str
    channels: tuple[ChannelInfo, ...]
    stamps_ns: npt.NDArray[np.int64]
    values: Array

    @property
    def period_s(self) -> float:
        """Time between two scans."""
        return float(np.median(np.diff(self.stamps_ns))) * 1e-9

    @property
    def seconds(self) -> float:
        """Length."""
        return float(self.stamps_ns[-1] - self.stamps_ns[0]) * 1e-9 + self.period_s

    def in_order(self, names: tuple[str, ...]) -> Array:
        """Columns of these channels; NaN where there is none of that name."""
        places = {row.name: column for column, row in enumerate(self.channels)}
        rows = np.full((len(self.values), len(names)), np.nan)
        for column, name in enumerate(names):
            if name in places:
                rows[:, column] = self.values[:, places[name]]
        return rows


def recorded_motions(path: Path, stand: Stand) -> Iterator[RecordedMotion]:
    """Recordings of a bag of ours, or of a file that the stand's channels.yaml describes.

    Raises
    ------
    RecordingError
        It is neither, or lacks what the mapping names.
    """
    if path.name.endswith(FLEA_SUFFIX):
        yield _of_the_flea(path)
        return
    mapping = channel_sources(stand) if stand.channels is not None else None
    if mapping is None or mapping.format != MAPPED or is_bag_of_ours(path):
        yield _of_bag(path)
        return
    for made in mapped_recordings(path, mapping):
        yield _of_scans(made.name, _rows(mapping), made.scans())


def _of_the_flea(path: Path) -> RecordedMotion:
    """A text file of the FLEA."""
    from flea_diag.tools.recordings.flea_data import read_flea_data
    from flea_diag.tools.recordings.flea_run import FleaRun

    run = FleaRun.of(read_flea_data(path))
    scans = tuple(run.scans())
    rows = tuple(row for row in run.channel_table().channels if row.name in scans[0].channels)
    return _of_scans(path.name.removesuffix(FLEA_SUFFIX), rows, scans)


def _rows(mapping: SourceMapping) -> tuple[ChannelInfo, ...]:
    """Rows of the channel table, with the rates of the readings."""
    return tuple(row.info(row.rate_hz) for row in mapping.channels)


def _of_bag(path: Path) -> RecordedMotion:
    table, scans = None, []
    for _, record in read_bag(path, (ChannelTable, Scan)):
        if isinstance(record, ChannelTable):
            table = record
        elif isinstance(record, Scan):
            scans.append(record)
    if table is None:
        raise RecordingError(f"{path}: no channel table; record it again, or name a raw recording")
    slow = tuple(row for row in table.channels if scans and row.name in scans[0].channels)
    return _of_scans(path.name, slow, tuple(scans))


def _of_scans(
    name: str, channels: tuple[ChannelInfo, ...], scans: tuple[Scan, ...]
) -> RecordedMotion:
    if len(scans) < FEWEST:
        raise RecordingError(f"{name}: {len(scans)} scans, at least {FEWEST} are needed")
    order = [row.name for row in channels]
    values = np.array([_values(scan, order) for scan in scans])
    return RecordedMotion(name, channels, np.array([scan.stamp_ns for scan in scans]), values)


def _values(scan: Scan, order: list[str]) -> list[float]:
    if list(scan.channels) == order:
        return list(scan.values)
    read = dict(zip(scan.channels, scan.values, strict=True))
    return [read.get(name, np.nan) for name in order]
