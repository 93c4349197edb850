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

"""A mapping says where each channel of a stand comes from; ``channels.yaml`` holds it."""

from __future__ import annotations

from dataclasses import dataclass
from fnmatch import fnmatchcase
from itertools import chain

from flea_diag.wire.records import ChannelInfo, ChannelTable
from flea_diag.wire.sources.field_path import FieldPath

HOLD, INTERPOLATE, MEAN = "hold", "interpolate", "mean"
DATENUM, DATENUM_OF_1970 = "datenum", 719529.0
"""Unit of MATLAB's serial dates, days since the year 0, and what they read in 1970."""
AGE_READINGS = 3.0
"""Declared intervals for which a reading is used, unless stated."""
RESAMPLINGS = (INTERPOLATE, HOLD, MEAN)
"""How readings become the value at the time of a scan: on the line between the readings before and
after it, the reading before it, or the mean of those nearer to it than to any other scan."""
MAPPED, FLEA_TEXT = "mapped", "flea_text"
FORMATS = (MAPPED, FLEA_TEXT)
"""Formats of recordings: as ``channels`` say, or the FLEA's text files, whose columns are fixed."""


@dataclass(frozen=True, slots=True)
class SourceTerm:
    """One number of a source: a field of a topic, or a column of a table.

    ``weight`` is its factor in the sum of the channel.
    """

    weight: float = 1.0
    topic: str = ""
    message: str = ""
    path: FieldPath | None = None
    column: str = ""

    @property
    def words(self) -> str:
        """The place as people name it."""
        return f"column {self.column}" if self.column else f"{self.topic} {self.path}"


@dataclass(frozen=True, slots=True)
class ChannelMapping:
    """One channel: ``factor`` times the sum of its terms, plus ``offset``, in ``unit`` (SI).

    ``minimum`` and ``maximum`` are in the same unit; ``rate_hz`` is that of the readings. A reading
    is used for at most ``age_s``. ``turn`` is the reading after which an angle begins anew, as it
    is written; 0 for any other reading.
    """

    channel: str
    unit: str
    terms: tuple[SourceTerm, ...]
    factor: float
    offset: float
    minimum: float
    maximum: float
    rate_hz: float
    resample: str
    age_s: float
    written: str
    serial: str = ""
    mount: str = ""
    sampling: str = "mean"
    note: str = ""
    turn: float = 0.0

    def info(self, rate_hz: float) -> ChannelInfo:
        """Row of the channel table."""
        return ChannelInfo(
            self.channel,
            self.unit,
            self.minimum,
            self.maximum,
            rate_hz,
            serial=self.serial,
            mount=self.mount,
            sampling=self.sampling,
            note=self.note,
        )


@dataclass(frozen=True, slots=True)
class AxisMapping:
    """One axis of an accelerometer, ``channel``: ``factor`` times a reading, in m/s^2.

    ``column`` is that of a table, or of the points of a PointCloud2 ``topic``; ``path`` a field of
    another ``topic``, with one sample a message or an array of them.
    """

    channel: str
    column: str
    factor: float
    minimum: float
    maximum: float
    rate_hz: float
    serial: str = ""
    mount: str = ""
    topic: str = ""
    message: str = ""
    path: FieldPath | None = None

    @property
    def info(self) -> ChannelInfo:
        """Row of the channel table."""
        return ChannelInfo(
            self.channel,
            "m/s^2",
            self.minimum,
            self.maximum,
            self.rate_hz,
            serial=self.serial,
            mount=self.mount,
        )


@dataclass(frozen=True, slots=True)
class TableTime:
    """Time of the rows of a table: a column, in seconds times ``factor``, from ``start_ns`` on.

    ``zero`` is what the column reads at ``start_ns``; MATLAB's days begin in the year 0, and no
    number of nanoseconds reaches there. Without a column the rows are as far apart as scans, or as
    readings of accelerometers.
    """

    column: str = ""
    factor: float = 1.0
    start_ns: int = 0
    zero: float = 0.0


@dataclass(frozen=True, slots=True)
class SourceMapping:
    """All channels of a stand, the rate of its scans, and how its files are cut and labelled.

    ``axes`` of accelerometers have one rate. ``truth`` holds patterns of names of recordings, each
    with the fault that they show.
    """

    where: str
    stand: str
    format: str
    rate_hz: float
    channels: tuple[ChannelMapping, ...]
    time: TableTime = TableTime()
    split_by: tuple[str, ...] = ()
    truth: tuple[tuple[str, str], ...] = ()
    axes: tuple[AxisMapping, ...] = ()

    @property
    def row_period_ns(self) -> int:
        """Time between two rows of a table that has no times."""
        return round(1e9 / self.axes[0].rate_hz) if self.axes else self.period_ns

    @property
    def vibration_topic(self) -> str:
        """Topic of the accelerometers; empty without, or where they are columns."""
        return self.axes[0].topic if self.axes else ""

    @property
    def period_ns(self) -> int:
        """Time between two scans."""
        return round(1e9 / self.rate_hz)

    @property
    def terms(self) -> tuple[SourceTerm, ...]:
        """Terms of all channels, in order."""
        return tuple(chain.from_iterable(row.terms for row in self.channels))

    @property
    def topics(self) -> dict[str, str]:
        """Message type of each topic."""
        return {term.topic: term.message for term in self.terms if term.topic}

    def channel_table(self, stamp_ns: int) -> ChannelTable:
        """Units, ranges and rates as the diagnosis reads them."""
        rows = [row.info(self.rate_hz) for row in self.channels]
        rows += [axis.info for axis in self.axes]
        return ChannelTable(stamp_ns, self.stand, tuple(rows))

    def fault_of(self, recording: str) -> str | None:
        """Fault that a recording of this name shows, if the mapping says so."""
        return next(
            (fault for pattern, fault in self.truth if fnmatchcase(recording, pattern)), None
        )
