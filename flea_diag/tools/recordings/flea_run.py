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

"""One FLEA run as records: SI units, our sign convention, truth from its name and motion.

The test motor in use is determined from the record (its current varies, that of the idle one is
flat), not from the label; no field of a Scan or of the channel table says which one it was.

Signs, by regression over running means of 0.21 s on the 49 runs without a position fault
(positive position extends). V = R i + K v, on the 38 whose voltage channel is sound, gives
R = +2.6 to +3.9 ohm but K = -135 to -194 V s/m: positive voltage RETRACTS and goes with
positive current, so both are flipped. i = a F + friction gives a = -0.006 to -0.022 A/N on the
driven motor: after the flip a positive measured load needs an extending current, so it opposes
extension, and is kept. The load motor's current has +0.0001 to +0.0047 A/N and friction of
-0.01 to -0.31 A sgn(v): it, too, retracts when positive, and is flipped.
"""

from __future__ import annotations

import hashlib
import math
import random
import re
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from flea_diag.errors import RecordingError
from flea_diag.tools.recordings.flea_data import FleaData
from flea_diag.wire.records import (
    NEVER_NS,
    ChannelInfo,
    ChannelTable,
    Scan,
    Truth,
    VibrationBlock,
)

RATE_HZ = 100.0
NEWTON_PER_POUND_FORCE = 4.4482216152605
ACTIVITY_RATIO = 3.0
"""Least ratio of the current variation (rms) of the driven motor to that of the idle one."""

POSITION_NOISE_MM = 0.06
POSITION_RESOLUTION_MM = 0.0036
STROKE_MM = 100.0
END_STOP_MM = 0.5
"""Distance to an end of the stroke within which the actuator is at its stop."""

RUN_AWAY_SEARCH = 200
"""Samples before the end stop within which a run-away must have begun (2 s)."""
SPEED_UP_WINDOW = 15
"""Samples over which an increase of speed is measured (0.15 s)."""


@dataclass(frozen=True)
class Source:
    """A channel of the Scan with its column (``{}``: the unit in use) and factor."""

    channel: str
    column: str
    factor: float
    unit: str
    sampling: str = "mean"
    maximum: float = math.inf
    note: str = ""


_FLIPPED = "sign flipped on import: positive retracts on this stand"
POSITION_COLUMN = "Actuator Z Position"
SOURCES: tuple[Source, ...] = (
    Source("motor_current", "Motor {} Current", -1.0, "A", note=_FLIPPED),
    Source("motor_voltage", "Motor {} Voltage", -1.0, "V", "instant_pwm", note=_FLIPPED),
    Source("actuator_position", POSITION_COLUMN, 1e-3, "m", maximum=1e-3 * STROKE_MM),
    Source("load_position", "", math.nan, "m", note="not recorded"),
    Source("load_force", "Measured Load", NEWTON_PER_POUND_FORCE, "N"),
    Source("motor_temperature", "Motor {} Temperature", 1.0, "degC"),
    Source("nut_temperature", "Nut {} Temperature", 1.0, "degC"),
    Source("ambient_temperature", "Ambient Temperature", 1.0, "degC"),
    Source("load_motor_current", "Motor Z Current", -1.0, "A", note=_FLIPPED),
)
CHANNELS = tuple(source.channel for source in SOURCES)


TEST_ACTUATOR = "test actuator"
MOUNTS = {"load_": "load actuator", "ambient_": "stand"}
"""Prefix of a channel -> its location; all others are on the test actuator."""


def _mount(source: Source) -> str:
    return next((m for name, m in MOUNTS.items() if source.channel.startswith(name)), TEST_ACTUATOR)


@dataclass(frozen=True)
class Label:
    """Information in the name of a run: the fault, and for a position fault its parameters."""

    fault: str
    time_s: float = math.nan
    offset_mm: float = 0.0
    scale: float = 1.0


_NAME = re.compile(
    r"_(?P<kind>Nominal|Jam|Spall|Position)"
    r"(?:_t(?P<t>[+-]?[\d.]+)_o(?P<o>[+-]?[\d.]+)_s(?P<s>[+-]?[\d.]+))?_Low$"
)
_FAULT = {"Nominal": "nominal", "Jam": "jam", "Spall": "spall"}


def label_of(name: str) -> Label | None:
    """Label in the name of a run (without ``.data``); None if there is no known label."""
    match = _NAME.search(name)
    if match is None:
        return None
    if match["kind"] in _FAULT:
        return Label(_FAULT[match["kind"]])
    try:
        time_s, offset_mm, scale = (float(match[key]) for key in "tos")
    except (TypeError, ValueError):
        return None
    return Label(_position_fault(offset_mm, scale), time_s, offset_mm, scale)


def _position_fault(offset_mm: float, scale: float) -> str:
    if scale == 0.0:
        return "actuator_position_dead"
    return "actuator_position_bias" if offset_mm else "actuator_position_scaling"


def active_motor(data: FleaData) -> str:
    """Return ``X`` or ``Y``: the test motor whose current varies.

    Raises
    ------
    RecordingError
        Neither motor is clearly the driven one.
    """
    activity = {unit: _activity(data.column(f"Motor {unit} Current")) for unit in "XY"}
    idle, driven = sorted(activity, key=lambda unit: activity[unit])
    if not activity[driven] > ACTIVITY_RATIO * activity[idle]:
        raise RecordingError(
            f"{data.path.name}: cannot tell which test motor runs: the currents of X and Y vary by "
            f"{activity['X']:.3f} A and {activity['Y']:.3f} A (rms), their ratio must be at least "
            f"{ACTIVITY_RATIO:g}"
        )
    return driven


def _activity(current: npt.NDArray[np.float64]) -> float:
    measured = current[np.isfinite(current)]
    return float(measured.std()) if len(measured) else 0.0


def find_run_away(position_mm: npt.NDArray[np.float64]) -> int | None:
    """Sample at which an actuator begins to run away after a loss of position feedback.

    The drive saturates at once, so the run-away begins with a sudden acceleration: within the
    2 s before the end stop is reached, the first interval of 0.15 s in which the speed towards
    the stop increases by at least 80 % of its largest increase. The run-away begins where this
    increase begins. None if the actuator never reaches an end stop.
    """
    at_stop = [np.flatnonzero(position_mm > STROKE_MM - END_STOP_MM)]
    at_stop.append(np.flatnonzero(position_mm < END_STOP_MM))
    if not any(len(samples) for samples in at_stop):
        return None
    first, direction = min(
        (int(samples[0]), sign)
        for samples, sign in zip(at_stop, (1, -1), strict=True)
        if len(samples)
    )
    start = max(0, first - RUN_AWAY_SEARCH)
    speed = direction * _speed(position_mm)[start : first + 1]
    if len(speed) <= SPEED_UP_WINDOW:
        return start
    growth = speed[SPEED_UP_WINDOW:] - speed[:-SPEED_UP_WINDOW]
    kick = int(np.argmax(growth >= 0.8 * growth.max()))
    stretch = speed[kick : kick + SPEED_UP_WINDOW + 1]
    slow = stretch <= stretch.min() + 0.1 * np.ptp(stretch)
    return start + kick + int(np.flatnonzero(slow)[-1])


def _speed(position_mm: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
    """Speed in mm/s over 60 ms around each sample."""
    padded = np.pad(position_mm, 3, mode="edge")
    return np.asarray((padded[6:] - padded[:-6]) * RATE_HZ / 6)


@dataclass(frozen=True)
class FleaRun:
    """A run ready to be written: input of the stages, and the truth, which they do not read."""

    data: FleaData
    unit: str
    label: Label | None
    onset: int | None
    onset_from: str
    serial: str = ""
    vibration: tuple[VibrationBlock, ...] = ()
    """None: the recordings hold no accelerometers."""

    @classmethod
    def of(cls, data: FleaData, serial: str = "") -> FleaRun:
        """Determine the motor in use, and fault and onset from the name.

        ``serial`` is the serial number of the test actuator, which is not recorded.
        """
        label = label_of(data.path.name.removesuffix(".data"))
        onset, onset_from = _onset(data, label)
        return cls(data, active_motor(data), label, onset, onset_from, serial)

    def channel_table(self) -> ChannelTable:
        """Units, ranges and signs; the same for every run and unit."""
        rows = tuple(
            ChannelInfo(
                source.channel,
                source.unit,
                -math.inf,
                source.maximum,
                RATE_HZ,
                serial=self.serial if _mount(source) == TEST_ACTUATOR else "",
                mount=_mount(source),
                sampling=source.sampling,
                note=source.note,
            )
            for source in SOURCES
        )
        return ChannelTable(int(self.data.stamps_ns[0]), "flea", rows)

    def truth(self) -> Truth | None:
        """Fault, onset and details from name and record; None without a label."""
        if self.label is None:
            return None
        details = [("run", self.data.path.name.removesuffix(".data")), ("test_actuator", self.unit)]
        if self.onset is not None:
            details.append(("onset_from", self.onset_from))
        if not math.isnan(self.label.time_s):
            details.append(("name_time_s", repr(self.label.time_s)))
            details.append(("name_offset_mm", repr(self.label.offset_mm)))
            details.append(("name_scale", repr(self.label.scale)))
        stamps = self.data.stamps_ns
        onset_ns = NEVER_NS if self.onset is None else int(stamps[self.onset])
        return Truth(int(stamps[0]), self.label.fault, onset_ns, tuple(details))

    def scans(self) -> Iterator[Scan]:
        """Every line as a Scan, in file order, with stamps as recorded."""
        columns = [self._channel(source) for source in SOURCES]
        rows = np.column_stack(columns).tolist()
        for stamp_ns, row in zip(self.data.stamps_ns.tolist(), rows, strict=True):
            yield Scan(stamp_ns, CHANNELS, tuple(row))

    def _channel(self, source: Source) -> npt.NDArray[np.float64]:
        if not source.column:
            return np.full(len(self.data.stamps_ns), math.nan)
        values = self.data.column(source.column.format(self.unit))
        if source.column == POSITION_COLUMN:
            values = self._position_mm(values)
        return source.factor * values

    def _position_mm(self, true_mm: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
        """Reading of the position sensor of the test actuator, reconstructed after the onset.

        This channel was not recorded. Before the onset it is the potentiometer of the load
        actuator; afterwards it is the reading of the controller, offset + scale * true, with
        noise added so that the total noise is the same as before.
        """
        if self.label is None or self.onset is None or math.isnan(self.label.time_s):
            return true_mm
        noise = random.Random(self._seed())
        sigma = POSITION_NOISE_MM * math.sqrt(max(0.0, 1.0 - self.label.scale**2))
        reading = true_mm.copy()
        for k in range(self.onset, len(reading)):
            value = self.label.offset_mm + self.label.scale * true_mm[k] + noise.gauss(0.0, sigma)
            steps = value / POSITION_RESOLUTION_MM
            if math.isfinite(steps):
                value = round(steps) * POSITION_RESOLUTION_MM
            reading[k] = min(value, STROKE_MM)
        return reading

    def _seed(self) -> int:
        return int.from_bytes(hashlib.sha256(self.data.values.tobytes()).digest()[:8], "little")


def _onset(data: FleaData, label: Label | None) -> tuple[int | None, str]:
    if label is None or label.fault == "nominal":
        return None, ""
    if math.isnan(label.time_s):
        return 0, "the faulty unit is in use throughout"
    found = find_run_away(data.column(POSITION_COLUMN))
    if found is not None:
        return found, "start of the run-away in the record"
    first_ns, last = int(data.stamps_ns[0]), len(data.stamps_ns) - 1
    named = int(np.searchsorted(data.stamps_ns, first_ns + int(label.time_s * 1e9)))
    return min(named, last), "the name: the record shows no run-away"
