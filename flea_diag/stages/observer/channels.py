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

"""Quality of each channel by itself: which readings are usable, and why others are not."""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from flea_diag.core import backend as backends
from flea_diag.core.residuals.residual_rows import ResidualSet
from flea_diag.core.scan_counts import ScanCounts
from flea_diag.core.sensors.channel_loops import glance_loops
from flea_diag.core.sensors.quality import BEYOND_BOUNDS, ChannelMonitor
from flea_diag.core.sensors.stale_rows import LEAST_CHANNELS, StaleRows
from flea_diag.wire.blocks import ScanBlock
from flea_diag.wire.records import ChannelQuality, ChannelTable, Quality

Array = npt.NDArray[np.float64]
Flags = npt.NDArray[np.bool_]

SENSOR_DEAD = "sensor dead, other channels valid: "
"""Prefix of the reason where one channel fails while others deliver values."""


class ChannelReadings(NamedTuple):
    """Readings of n scans, shape (n, channels), NaN = not measured.

    In the order of ``ResidualSet.channels``. ``raw``: as received. ``usable``: also NaN where a
    value is out of range. ``steady``: whether a value leaves the state of its channel unchanged;
    None where all of them do.
    """

    raw: Array
    usable: Array
    steady: Flags | None


class Channels:
    """Monitors of the channels that a calibration knows.

    Scans that change no channel's state are counted together; the monitors get the count when
    something changes.
    """

    def __init__(
        self,
        rows: ResidualSet,
        known: Collection[str],
        distrust: str,
        backend: str = "auto",
        *,
        counts: ScanCounts,
    ) -> None:
        self._index, self._width = rows.index, len(rows.channels)
        self._voltage = rows.channel(rows.voltage)
        self._compiled = backends.chosen(backend) == "numba"
        self._distrust = distrust
        self._monitors = {
            k: ChannelMonitor(n, counts=counts) for n, k in rows.index.items() if n in known
        }
        self._layout: tuple[str, ...] = ()
        self._from = self._to = np.empty(0, dtype=int)
        self._said: tuple[str, ...] = ()
        self._steady_scans, self._steady_ns = 0, 0
        self._stale = StaleRows(self._width)
        self._look()

    def take_ranges(self, table: ChannelTable) -> None:
        """Use the ranges of a channel table; a channel that it does not name has none."""
        ranges = {row.name: (row.minimum, row.maximum) for row in table.channels}
        self._count()
        for monitor in self._monitors.values():
            monitor.minimum, monitor.maximum = ranges.get(monitor.channel, (-math.inf, math.inf))
        self._look()

    def read(self, block: ScanBlock) -> ChannelReadings:
        """Readings of n scans; a scan that repeats the one before in all channels has none."""
        layout = block.channels
        if layout != self._layout:
            index = self._index
            places = {index[name]: k for k, name in enumerate(layout) if name in index}
            to = [column for column in places if column in self._monitors]
            self._to = np.array(to, dtype=int)
            self._from = np.array([places[column] for column in to], dtype=int)
            self._layout = layout
        raw = np.empty((len(block), self._width))
        if self._compiled and self._glance(block.values, raw):
            return ChannelReadings(raw, raw, None)
        raw.fill(np.nan)
        raw[:, self._to] = block.values.take(self._from, axis=1)
        stale = self._stale.find(raw)
        if stale is not None:
            self._leave_out(raw, stale)
        steady = (raw > self._low) & (raw < self._high)
        steady |= np.isnan(raw) & self._lacking
        if steady.all():
            return ChannelReadings(raw, raw, None)
        inside = (raw >= self._least) & (raw <= self._most)
        return ChannelReadings(raw, np.where(inside, raw, np.nan), steady)

    def _glance(self, values: Array, raw: Array) -> bool:
        """Fill ``raw``; whether every channel is steady, which ends the work for most scans."""
        places, bounds = (self._from, self._to), (self._low, self._high, self._lacking)
        steady: bool = backends.exact(glance_loops)(
            values, places, bounds, LEAST_CHANNELS, self._stale.last, raw
        )
        return steady

    def _leave_out(self, raw: Array, stale: Flags) -> None:
        """Count repeated readings as stale and set them to not measured."""
        read = np.count_nonzero(~np.isnan(raw[stale]), axis=0).tolist()
        for column, monitor in self._monitors.items():
            monitor.counters["stale"] += read[column]
        raw[stale] = np.nan

    def judge(
        self, stamps_ns: npt.NDArray[np.int64], reading: ChannelReadings, trusted: Flags
    ) -> int:
        """Update the channel states over n scans; the first scan that changes one, or n.

        ``trusted``, shape (n,), is the result of the cross-check of the voltage.
        """
        rows, steady = reading.raw, reading.steady
        believed = np.count_nonzero(trusted) == len(trusted)
        if believed and self._said and steady is None:
            self._steady_scans += len(rows)
            self._steady_ns = int(stamps_ns[-1])
            return len(rows)
        self._count()
        as_before: Flags = np.ones(self._width, dtype=bool)
        if steady is not None:
            as_before = np.all(steady, axis=0)
        if self._voltage >= 0:
            as_before[self._voltage] &= believed
        first = len(rows) if self._said else 0
        for column, monitor in self._monitors.items():
            if as_before[column]:
                monitor.pass_over(len(rows), int(stamps_ns[-1]))
            else:
                doubted = trusted if column == self._voltage else np.ones_like(trusted)
                first = min(first, self._step(monitor, stamps_ns, rows[:, column], doubted))
        self._look()
        self._said = tuple(monitor.state.quality for monitor in self._monitors.values())
        return first

    def _step(
        self,
        monitor: ChannelMonitor,
        stamps_ns: npt.NDArray[np.int64],
        values: Array,
        trusted: Flags,
    ) -> int:
        """Update one channel value by value; the first that changes its state, or their number."""
        before, first = monitor.state.quality, len(values)
        columns = zip(stamps_ns.tolist(), values.tolist(), trusted.tolist(), strict=True)
        for number, (stamp_ns, value, believed) in enumerate(columns):
            monitor.step(stamp_ns, value, believed, self._distrust)
            if monitor.state.quality != before:
                first = min(first, number)
        return first

    def _count(self) -> None:
        """Add the scans counted together to the monitors."""
        if self._steady_scans:
            for monitor in self._monitors.values():
                monitor.pass_over(self._steady_scans, self._steady_ns)
            self._steady_scans = 0

    def _look(self) -> None:
        """Update the bounds within which a value leaves its channel's state unchanged."""
        self._least, self._most = np.full((2, self._width), np.nan)
        self._low, self._high = np.full((2, self._width), np.nan)
        self._lacking = np.array([column not in self._monitors for column in range(self._width)])
        for column, monitor in self._monitors.items():
            self._least[column] = max(monitor.minimum, -BEYOND_BOUNDS)
            self._most[column] = min(monitor.maximum, BEYOND_BOUNDS)
            self._lacking[column] = monitor.lacks
            if monitor.reads:
                self._low[column], self._high[column] = self._least[column], self._most[column]

    @property
    def driver_dead(self) -> bool:
        """Whether all channels that ever had values have stopped; one alone is a sensor fault."""
        read = [m for m in self._monitors.values() if m.state.quality != "absent"]
        return len(read) > 1 and all(monitor.silent for monitor in read)

    def states(self, stuck: Mapping[str, int]) -> tuple[ChannelQuality, ...]:
        """State and counters of every channel; ``stuck`` is counted by the sensor tests."""
        self._count()
        alone = "" if self.driver_dead else SENSOR_DEAD
        return tuple(
            ChannelQuality(
                m.channel,
                Quality(m.state.quality),
                m.state.since_ns,
                (alone if m.silent else "") + m.state.reason,
                (*m.counters.items(), ("stuck", stuck.get(m.channel, 0))),
                m.read_ns,
            )
            for m in self._monitors.values()
        )
