"""Always-on watch of vibration, for faults that no slow channel shows (spall).

Two condition indicators of each block are held against their nominal ranges at its operating
point: the level, as standard deviation, and the kurtosis. Units differ in their level by more
than a small pit adds to it; a pit strikes, and what strikes has a kurtosis that no gain, no
resonance and no background gives a healthy unit. ``RAISED`` of the last ``BLOCKS`` blocks on the
same side of the range raise the alarm: one loud block, or the knock of one reversal, does not.
Blocks in motion and at rest are counted apart: a pit is heard in motion alone, however long the
actuator rests in between.
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

BLOCKS = 10
RAISED = 6
SCANS = 10
"""Scans of one block, over which speed and load are averaged (rms)."""

SECTIONS: dict[tuple[str, bool], str] = {
    ("std", True): "levels",
    ("std", False): "resting_levels",
    ("kurtosis", True): "kurtosis",
}
"""Indicator, and whether the actuator moves -> the nominal ranges that it is held against."""

WORDS = {"std": "level {:.3g} m/s^2", "kurtosis": "kurtosis {:.3g}"}


@dataclass(frozen=True)
class VibrationAlarm:
    """What raised the alarm: an indicator of one axis, and on which side of its range it is."""

    axis: str
    indicator: str
    side: str
    words: str

    @property
    def feature(self) -> str:
        """The feature of the accelerometer to which this is an answer."""
        return f"{self.axis.rsplit('_', 1)[0]}_{self.indicator}"


class VibrationMonitor:
    """Streams indicators of blocks; silent where no nominal range was ever learned."""

    def __init__(self, nominal: NominalRanges) -> None:
        self._ranges: dict[tuple[str, bool], Mapping[str, NominalRange]] = {
            watched: getattr(nominal, section) for watched, section in SECTIONS.items()
        }
        self._speed: deque[float] = deque(maxlen=SCANS)
        self._load: deque[float] = deque(maxlen=SCANS)
        self._sides: dict[tuple[str, str, bool], deque[int]] = {}

    def motion(self, speed: float, load_n: float) -> None:
        """Speed and load of one scan."""
        self._speed.append(speed)
        self._load.append(load_n)

    def clear(self) -> None:
        """Forget which blocks were out of their range."""
        self._sides.clear()

    def step(
        self, axes: Sequence[str], std: Sequence[float], kurtosis: Sequence[float] = ()
    ) -> VibrationAlarm | None:
        """The alarm that this block raises, the level before the kurtosis, or None."""
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
        """Note on which side of its range a value is; the alarm, if too many were there."""
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
