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

"""Validation of features on real bearing recordings (MATLAB files of drive-end acceleration).

Nominal ranges are learned on the first half of a normal recording. False alarms are counted on
its second half, detections on recordings with faults.
"""

from __future__ import annotations

import math
import zlib
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import IO

import numpy as np
import numpy.typing as npt

from flea_diag.core.vibration.bearing_frequencies import Bearing
from flea_diag.core.vibration.features import FEATURES, Scope, compute_all
from flea_diag.core.vibration.features_envelope import named_line
from flea_diag.core.vibration.nominal_range import (
    NominalRange,
    VibrationOperatingPoint,
    learn_nominal,
)
from flea_diag.core.vibration.window import Window
from flea_diag.errors import CalibrationError, RecordingError
from flea_diag.wire.regular_file import opened

SKF_6205 = Bearing(pitch_diameter_m=39.04e-3, ball_diameter_m=7.94e-3, balls=9)
"""Drive-end bearing of the Case Western Reserve University stand."""

AXIS = "accelerometer_1_x"
LARGEST_BYTES = 256 << 20
MOST_SAMPLES = 20_000_000
_UNREADABLE = (
    OSError,
    ValueError,
    NotImplementedError,
    TypeError,
    LookupError,
    OverflowError,
    zlib.error,
)
GRAVITY_M_S2 = 9.80665


@dataclass(frozen=True)
class BearingRecording:
    """One recording at constant speed."""

    name: str
    samples: npt.NDArray[np.float32]
    rate_hz: float
    speed_rad_s: float
    orders: Mapping[str, float]

    def windows(self, window_s: float) -> list[Window]:
        """Consecutive windows without overlap."""
        points = round(window_s * self.rate_hz)
        return [
            Window(
                self.samples[start : start + points, np.newaxis],
                self.rate_hz,
                (AXIS,),
                np.full(points, self.speed_rad_s),
                orders=self.orders,
            )
            for start in range(0, len(self.samples) - points + 1, points)
        ]


def read_bearing(path: Path, rate_hz: float, rpm: float) -> BearingRecording:
    """Read the drive-end channel (``*_DE_time``, in g) of one file.

    Raises
    ------
    RecordingError
        The file cannot be read, or does not contain this channel.
    """
    from scipy.io.matlab import MatReadError

    try:
        with opened(path, LARGEST_BYTES) as stream:
            values = _drive_end(stream, path)
    except (*_UNREADABLE, MatReadError) as error:
        raise RecordingError(f"{path}: cannot be read as a MATLAB file: {error}") from error
    samples = values.ravel() * np.float32(GRAVITY_M_S2)
    orders = SKF_6205.orders()
    return BearingRecording(path.stem, samples, rate_hz, rpm * 2.0 * np.pi / 60.0, orders)


def _drive_end(stream: IO[bytes], path: Path) -> npt.NDArray[np.float32]:
    """Values of the drive-end channel alone: packed ones are not unpacked before they are counted.

    Raises
    ------
    RecordingError
        The file does not contain this channel, or too much of it.
    """
    from scipy.io import loadmat, whosmat

    shapes = {name: shape for name, shape, _ in whosmat(stream) if name.endswith("_DE_time")}
    if not shapes:
        raise RecordingError(f"{path}: no drive-end channel *_DE_time")
    name, shape = next(iter(shapes.items()))
    if math.prod(shape) > MOST_SAMPLES:
        raise RecordingError(
            f"{path}: {name} holds {math.prod(shape)} samples, above the limit of {MOST_SAMPLES}"
        )
    stream.seek(0)
    return np.asarray(loadmat(stream, variable_names=[name])[name], dtype=np.float32)


@dataclass(frozen=True)
class Judgement:
    """One feature: nominal range, and share of windows outside it in each recording."""

    feature: str
    found: NominalRange
    false_alarms: float
    detected: Mapping[str, float]


def features_of_one_axis() -> list[str]:
    """Features computable from one axis of one accelerometer at constant speed."""
    needless = {"axis_coherence", "mean", "rest_std", "rest_moving_ratio", "reversal_ratio",
                "speed_correlation", "current_correlation", "nut_line", "screw_line",
                "ball_line"}  # fmt: skip
    return [
        f"accelerometer_1_{row.name}"
        for row in FEATURES.values()
        if row.scope is Scope.ACCELEROMETER and row.name not in needless
    ]


def judge(
    normal: BearingRecording,
    faulty: list[BearingRecording],
    window_s: float,
    false_alarm_rate: float,
) -> list[Judgement]:
    """False alarms on the second half of ``normal`` and detections, for each feature."""
    ids = features_of_one_axis()
    healthy = [compute_all(ids, window) for window in normal.windows(window_s)]
    half = len(healthy) // 2
    broken = {r.name: [compute_all(ids, w) for w in r.windows(window_s)] for r in faulty}
    found: list[Judgement] = []
    for feature in ids:
        values = [row[feature] for row in healthy]
        try:
            nominal = learn_nominal(values[:half], false_alarm_rate)
        except CalibrationError:
            continue
        found.append(
            Judgement(
                feature,
                nominal,
                _outside(nominal, values[half:]),
                {n: _outside(nominal, [r[feature] for r in rows]) for n, rows in broken.items()},
            )
        )
    return found


def lines(recording: BearingRecording, window_s: float = 1.0) -> list[str]:
    """Name of the ball-pass line in each window."""
    return [named_line(window) for window in recording.windows(window_s)]


def _outside(nominal: NominalRange, values: list[float]) -> float:
    symbols = [nominal.symbol(value, VibrationOperatingPoint()) for value in values]
    return sum(symbol in "+-" for symbol in symbols) / len(symbols)
