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

"""Recent history for strip charts: minimum and maximum of each short interval.

A chart has fewer pixels than a stream has samples. The samples of one pixel are reduced to their
range, so that no peak is lost and a browser receives a tenth of the numbers.
"""

from __future__ import annotations

import math
import threading
from collections import deque
from collections.abc import Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from flea_diag.operator.quantity import unit_of
from flea_diag.operator.stream import JUMP_NS
from flea_diag.operator.words import tr
from flea_diag.wire.records import ChannelTable, Record, Residual, Scan, VibrationLevel

Array = npt.NDArray[np.float64]
Row = tuple[int, list[float | None]]
"""Number of the interval since the epoch, and its values."""

STRETCH_NS = {"residual": 100_000_000, "channel": 100_000_000, "vibration": 200_000_000}
"""Kinds of strip charts and the length of their intervals, each a few samples."""
KEPT_NS = 60_000_000_000
PAST_S = 600
"""What is older than ``KEPT_NS`` is kept so long, as the range of each second."""


class Strip:
    """Columns of one stream.

    Parameters
    ----------
    names
        Names of the values; each has columns ``lo`` and ``hi``.
    stretch_ns
        Length of an interval.
    """

    def __init__(self, names: Sequence[str], stretch_ns: int) -> None:
        self.names, self._stretch_ns = tuple(names), stretch_ns
        self._rows: deque[Row] = deque()
        self._past: deque[Row] = deque(maxlen=PAST_S)
        self._most, self._many = KEPT_NS // stretch_ns, 1_000_000_000 // stretch_ns
        self._lock = threading.Lock()
        self._open = -1
        self._low = np.full(len(self.names), np.nan)
        self._high = self._low.copy()
        self._latest: Sequence[float] = ()

    def add(self, stamp_ns: int, values: Sequence[float], latest: Sequence[float] = ()) -> bool:
        """Add one sample; False if it belongs to another run and was not added.

        ``latest`` are further values of which the last is kept: estimates, limits.
        """
        stretch = stamp_ns // self._stretch_ns
        if stretch < self._open:
            return stretch > self._open - JUMP_NS // self._stretch_ns
        sample = np.asarray(values, dtype=np.float64)
        if stretch > self._open:
            self._close(stretch)
            self._low, self._high = sample, sample
        else:
            self._low = np.fmin(self._low, sample)
            self._high = np.fmax(self._high, sample)
        self._latest = latest
        return True

    def _close(self, following: int) -> None:
        if self._open >= 0:
            row = [_sent(v) for pair in zip(self._low, self._high, strict=True) for v in pair]
            row += [_sent(v) for v in self._latest]
            with self._lock:
                self._rows.append((self._open, row))
                if len(self._rows) >= self._most + self._many:
                    self._coarsen()
        self._open = following

    def _coarsen(self) -> None:
        """Make the oldest second of rows one row."""
        second = self._rows[0][0] // self._many
        rows = []
        while self._rows and self._rows[0][0] // self._many == second:
            rows.append(self._rows.popleft()[1])
        self._past.append((second, _reduced(rows, 2 * len(self.names))))

    def past(self) -> list[Row]:
        """Seconds before the kept intervals, oldest first: number since the epoch and values."""
        with self._lock:
            return list(self._past)

    def after(self, stretch: int) -> list[Row]:
        """Complete intervals after this one, oldest first."""
        new: list[Row] = []
        with self._lock:
            for row in reversed(self._rows):
                if row[0] <= stretch:
                    break
                new.append(row)
        return new[::-1]


def _reduced(rows: list[list[float | None]], ranges: int) -> list[float | None]:
    """Least and largest values of columns that alternate so, and the last of the others."""
    reduced: list[float | None] = []
    for k, column in enumerate(zip(*rows, strict=True)):
        known = [value for value in column if value is not None]
        if not known:
            reduced.append(None)
        elif k >= ranges:
            reduced.append(known[-1])
        else:
            reduced.append(max(known) if k % 2 else min(known))
    return reduced


def _sent(value: float) -> float | None:
    """Value with five digits; None for NaN, which JSON does not have."""
    return float(f"{value:.5g}") if value - value == 0.0 else None


class StripCharts:
    """Data of all strip charts: channels with estimates, residuals with limits, vibration.

    ``generation`` increases when the columns change or a new run begins; charts then restart.
    """

    def __init__(self) -> None:
        self.generation = 0
        self._units: dict[str, str] = {}
        self._limits: dict[str, float] = {}
        self._strips: dict[str, Strip] = {}
        self._estimated: dict[str, tuple[float, float]] = {}

    def take(self, record: Record) -> None:
        """Add a record of a stream; other records are ignored."""
        if isinstance(record, Scan):
            estimates = [
                value
                for name in record.channels
                for value in self._estimated.get(name, (np.nan, np.nan))
            ]
            self._add("channel", record.stamp_ns, record.channels, record.values, estimates)
        elif isinstance(record, Residual):
            rows = zip(record.estimated, record.estimates, record.estimate_sigmas, strict=True)
            self._estimated = {name: (value, sigma) for name, value, sigma in rows}
            if set(self._limits) != set(record.names):
                self._limits = dict(zip(record.names, record.thresholds, strict=True))
            self._add("residual", record.stamp_ns, record.names, record.z, record.thresholds)
        elif isinstance(record, VibrationLevel):
            names = (*record.axes, *(axis + " kurtosis" for axis in record.axes if record.kurtosis))
            self._add("vibration", record.stamp_ns, names, (*record.std, *record.kurtosis), ())
        elif isinstance(record, ChannelTable):
            units = {row.name: row.unit for row in record.channels}
            self.generation += units != self._units
            self._units = units

    def _add(
        self,
        kind: str,
        stamp_ns: int,
        names: tuple[str, ...],
        values: Sequence[float],
        latest: Sequence[float],
    ) -> None:
        strip = self._strips.get(kind)
        if strip is None or strip.names != names or not strip.add(stamp_ns, values, latest):
            self._strips[kind] = strip = Strip(names, STRETCH_NS[kind])
            strip.add(stamp_ns, values, latest)
            self.generation += 1

    def description(self, kind: str) -> list[dict[str, Any]]:
        """One entry per chart: name, unit, and the columns of its values in a row."""
        strip = self._strips.get(kind)
        names = strip.names if strip is not None else ()
        first = 2 * len(names)
        charts = []
        for k, name in enumerate(names):
            chart = {"name": name, "unit": self._unit(kind, name), "low": 2 * k, "high": 2 * k + 1}
            if kind == "channel":
                chart |= {"estimate": first + 2 * k, "sigma": first + 2 * k + 1}
            elif kind == "residual":
                chart |= {"limit": first + k}
            charts.append(chart)
        return charts

    def _unit(self, kind: str, name: str) -> str:
        if kind != "residual":
            return self._units.get(name, "")
        return tr(unit_of(name, self._limits.get(name, math.nan)))

    def past(self, kind: str) -> list[Row]:
        """Seconds of one kind before the rows of the last minute."""
        strip = self._strips.get(kind)
        return strip.past() if strip is not None else []

    def after(self, kind: str, stretch: int) -> list[Row]:
        """Rows of one kind that are newer than ``stretch``."""
        strip = self._strips.get(kind)
        return strip.after(stretch) if strip is not None else []
