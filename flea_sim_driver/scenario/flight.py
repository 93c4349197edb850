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

"""The flight interface: an aircraft's control surface drives the stand.

A CSV with the columns ``time_s, position_m, load_N``, or a bag, is used unchanged, or scaled into
stroke and load limits if the scenario says so. A flight that the stand cannot follow is refused
with the offending row.
"""

from __future__ import annotations

import csv
import io
import math
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from flea_diag.errors import ConfigurationError, shown
from flea_diag.wire.regular_file import opened
from flea_sim_driver.machine.machine import Limits

if TYPE_CHECKING:
    from scipy.interpolate import PchipInterpolator

    from flea_diag.wire.records import Scan

COLUMNS = ("time_s", "position_m", "load_N")
GAP_LIMIT_S = 0.5
BAG_SCANS = 10
BAG_CHANNELS = (
    ("commanded_position", "actuator_position", "load_position"),
    ("commanded_load", "load_force"),
)
FILE_LIMIT_BYTES = 64 << 20
Array = npt.NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Flight:
    """Position and load of a control surface; speed has no jumps between its rows."""

    time_s: Array
    position_m: Array
    load_n: Array

    @property
    def duration_s(self) -> float:
        """Time of the last row after the first."""
        return float(self.time_s[-1] - self.time_s[0])

    def at(self, time_s: Array) -> tuple[Array, Array]:
        """Position in m and load in N at times after the first row; held after the last."""
        when = np.clip(time_s + self.time_s[0], self.time_s[0], self.time_s[-1])
        return np.asarray(self._path(when)), np.interp(when, self.time_s, self.load_n)

    @cached_property
    def _path(self) -> PchipInterpolator:
        """A smooth curve that passes no row's position by."""
        from scipy.interpolate import PchipInterpolator  # slow to import, and few stands fly

        return PchipInterpolator(self.time_s, self.position_m)

    def acceleration_m_s2(self) -> Array:
        """Of the curve, the greatest in each step between rows, shape (rows - 1,)."""
        second = self._path.derivative(2)
        inside = np.diff(self.time_s) * 1e-9
        ends = second(self.time_s[:-1] + inside), second(self.time_s[1:] - inside)
        return np.asarray(np.max(np.abs(ends), axis=0))


def fitted(flight: Flight, limits: Limits) -> Flight:
    """The flight with travel and load scaled into the limits of the machine if they are larger."""
    stroke_m, load_n = limits.stroke_m, limits.load_n
    low, high = float(flight.position_m.min()), float(flight.position_m.max())
    position = flight.position_m
    if low < 0.0 or high > stroke_m:
        room = stroke_m - 2.0 * limits.flight_margin_m
        scale = min(1.0, room / max(high - low, 1e-9))
        position = 0.5 * stroke_m + scale * (position - 0.5 * (low + high))
    peak = float(np.abs(flight.load_n).max())
    load = flight.load_n * (load_n / peak if peak > load_n else 1.0)
    return Flight(flight.time_s, position, load)


def read_flight(path: Path, limits: Limits, *, fit: bool = False) -> Flight:
    """Read and check one flight; ``fit`` scales it into stroke and load first.

    Raises
    ------
    ConfigurationError
        Unreadable, wrong columns, gaps, or outside stroke, speed or load: names file and row.
    RecordingError
        A bag that cannot be read.
    """
    rows = _rows_of_bag(path) if path.is_dir() or path.suffix == ".mcap" else _rows(path)
    table = np.array(rows, dtype=np.float64).reshape(-1, 3)
    if len(table) < 2:
        raise ConfigurationError(f"{path}: {len(table)} rows, a flight needs at least 2")
    flight = Flight(table[:, 0].copy(), table[:, 1].copy(), table[:, 2].copy())
    if fit:
        flight = fitted(flight, limits)
    _check(flight, limits, path)
    return flight


def _rows(path: Path) -> list[list[float]]:
    try:
        file = opened(path, FILE_LIMIT_BYTES, ConfigurationError)
        with io.TextIOWrapper(file, encoding="utf-8", newline="") as stream:
            reader = csv.reader(stream)
            header = tuple(cell.strip() for cell in next(reader, []))
            if header != COLUMNS:
                found = ", ".join(header)[:80] or "none"
                raise ConfigurationError(f"{path}: columns {found}, must be {', '.join(COLUMNS)}")
            return [_row(cells, path, reader.line_num) for cells in reader if cells]
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise ConfigurationError(f"{path}: cannot be read: {error}") from error


def _rows_of_bag(path: Path) -> list[list[float]]:
    """Position and load of a recording, averaged over 0.1 s to reduce noise."""
    from flea_diag.wire.bags.bag import read_bag
    from flea_diag.wire.records import Scan

    scans = [record for _, record in read_bag(path, [Scan]) if isinstance(record, Scan)]
    rows: list[list[float]] = []
    for first in range(0, len(scans) - BAG_SCANS + 1, BAG_SCANS):
        group = scans[first : first + BAG_SCANS]
        elapsed_ns = float(np.mean([scan.stamp_ns - scans[0].stamp_ns for scan in group]))
        rows.append([elapsed_ns * 1e-9, *(_first(group, names) for names in BAG_CHANNELS)])
    if not np.isfinite(rows).all():
        raise ConfigurationError(
            f"{path}: a scan lacks position or load, one of "
            f"{' or '.join(', '.join(names) for names in BAG_CHANNELS)}"
        )
    return rows


def _first(group: list[Scan], names: tuple[str, ...]) -> float:
    """Mean of the first of these channels that is measured throughout."""
    for name in names:
        value = float(np.mean([scan.value(name) for scan in group]))
        if math.isfinite(value):
            return value
    return math.nan


def _row(cells: list[str], path: Path, line: int) -> list[float]:
    try:
        values = [float(cell) for cell in cells]
    except ValueError:
        values = []
    if len(values) != len(COLUMNS) or not all(math.isfinite(value) for value in values):
        raise ConfigurationError(
            f"{path}, line {line}: {shown(','.join(cells))} is not three finite numbers"
        )
    return values


def _check(flight: Flight, limits: Limits, path: Path) -> None:
    step = np.diff(flight.time_s)
    with np.errstate(divide="ignore", invalid="ignore"):
        speed = np.abs(np.diff(flight.position_m)) / step
    checks = (
        (step <= 0.0, step, "time step", "above 0 s: time must rise"),
        (step > GAP_LIMIT_S, step, "gap", f"at most {GAP_LIMIT_S} s"),
        (
            (flight.position_m < 0.0) | (flight.position_m > limits.stroke_m),
            flight.position_m,
            "position_m",
            f"0 to {limits.stroke_m} m: fit: true scales it",
        ),
        (
            np.abs(flight.load_n) > limits.load_n,
            flight.load_n,
            "load_N",
            f"within +-{limits.load_n:.1f} N: fit: true scales it",
        ),
        (
            speed > limits.flight_speed_m_s,
            speed,
            "speed in m/s",
            f"at most {limits.flight_speed_m_s} m/s",
        ),
    )
    for bad, values, name, limit in checks:
        if bad.any():
            row = int(np.argmax(bad))
            raise _refusal(path, flight, row, f"{name} = {values[row]:g}, must be {limit}")
    acceleration = flight.acceleration_m_s2()
    row = int(np.argmax(acceleration))
    if acceleration[row] > limits.flight_acceleration_m_s2:
        asked = f"acceleration in m/s^2 = {acceleration[row]:.3g}"
        raise _refusal(
            path, flight, row, f"{asked}, must be at most {limits.flight_acceleration_m_s2}"
        )


def _refusal(path: Path, flight: Flight, row: int, reason: str) -> ConfigurationError:
    return ConfigurationError(f"{path}, row {row + 1} (time_s {flight.time_s[row]:g}): {reason}")
