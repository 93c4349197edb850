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

"""Vibration monitor: always on, for faults that no slow channel shows (spall).

Two condition indicators of each block are compared with their nominal ranges at its operating
point: the level, as standard deviation, and the kurtosis. Healthy units differ in level by more
than a small pit adds. A pit causes impacts, which raise the kurtosis beyond what gain, resonance
or background of a healthy unit can. An alarm needs ``RAISED`` of the last ``BLOCKS`` blocks on the
same side of the range, so that one loud block or the knock of one reversal raises none. Blocks in
motion and at rest are counted apart: a pit shows in motion only.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from flea_diag.core.vibration.nominal_range import (
    NominalRange,
    NominalRanges,
    VibrationOperatingPoint,
)

BLOCKS = 10  # assumption: 1 s of blocks of 0.1 s
RAISED = 6  # assumption: more than half
SCANS = 10
"""Scans of one block, over which the RMS of speed and load is taken."""

SECTIONS: dict[tuple[str, bool], str] = {
    ("std", True): "levels",
    ("std", False): "resting_levels",
    ("kurtosis", True): "kurtosis",
}
"""Indicator, and whether the actuator moves -> section of the nominal ranges."""

WORDS = {"std": "level {:.3g} m/s^2", "kurtosis": "kurtosis {:.3g}"}


@dataclass(frozen=True)
class VibrationAlarm:
    """An indicator of one axis outside its nominal range, and on which side."""

    axis: str
    indicator: str
    side: str
    words: str

    @property
    def feature(self) -> str:
        """The feature of the accelerometer whose value this alarm determines."""
        return f"{self.axis.rsplit('_', 1)[0]}_{self.indicator}"


class VibrationMonitor:
    """Tests the indicators of each block; without nominal ranges it raises no alarm."""

    def __init__(self, nominal: NominalRanges) -> None:
        self._ranges: dict[tuple[str, bool], Mapping[str, NominalRange]] = {
            watched: getattr(nominal, section) for watched, section in SECTIONS.items()
        }
        self._speed: deque[float] = deque(maxlen=SCANS)
        self._load: deque[float] = deque(maxlen=SCANS)
        self._sides: dict[tuple[str, str, bool], deque[int]] = {}

    def motion(self, speed: float, load_n: float) -> None:
        """Take speed and load of one scan."""
        self._speed.append(speed)
        self._load.append(load_n)

    def clear(self) -> None:
        """Clear the record of blocks outside their range."""
        self._sides.clear()

    def step(
        self, axes: Sequence[str], std: Sequence[float], kurtosis: Sequence[float] = ()
    ) -> VibrationAlarm | None:
        """The alarm raised by this block, level before kurtosis, or None."""
        point = VibrationOperatingPoint(_rms(self._speed), _rms(self._load))
        alarm = None
        for indicator, values in (("std", std), ("kurtosis", kurtosis)):
            ranges = self._ranges.get((indicator, point.moving), {})
            for axis, value in zip(axes, values, strict=False):
                if axis in ranges:
                    found = self._judge(axis, indicator, value, ranges[axis].at(point), point)
                    alarm = alarm or found
        return alarm

    def _judge(
        self,
        axis: str,
        indicator: str,
        value: float,
        nominal: tuple[float, float],
        point: VibrationOperatingPoint,
    ) -> VibrationAlarm | None:
        """Count the sides of its range that an indicator was on; the alarm, if too many."""
        low, high = nominal
        recent = self._sides.setdefault((axis, indicator, point.moving), deque(maxlen=BLOCKS))
        recent.append(int(value > high) - int(value < low))
        out = max(recent.count(1), recent.count(-1))
        if out < RAISED:
            return None
        words = (
            f"{axis}: {WORDS[indicator].format(value)}, nominal {low:.3g} to {high:.3g}, outside "
            f"in {out} of the last {len(recent)} blocks "
            f"{'in motion' if point.moving else 'at rest'}"
        )
        return VibrationAlarm(axis, indicator, "+" if sum(recent) > 0 else "-", words)


def _rms(values: Sequence[float]) -> float:
    return math.sqrt(sum(v * v for v in values) / len(values)) if values else math.nan
