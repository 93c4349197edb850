"""Always-on watch of the vibration level, for faults that no slow channel shows (spall).

A level is held against its nominal range at the operating point of the block. ``RAISED`` of
the last ``BLOCKS`` blocks above the range raise the alarm; one loud block does not.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Sequence

from flea_diag.core.feature_table import NominalRanges
from flea_diag.core.nominal_range import OperatingPoint

BLOCKS = 10
RAISED = 6
SCANS = 10
"""Scans of one block, over which speed and load are averaged (rms)."""


class Sentinel:
    """Streams block levels; silent where no nominal level was ever learned."""

    def __init__(self, nominal: NominalRanges) -> None:
        self._levels = nominal.levels
        self._speed: deque[float] = deque(maxlen=SCANS)
        self._load: deque[float] = deque(maxlen=SCANS)
        self._raised: dict[str, deque[bool]] = {}

    def motion(self, speed: float, load_n: float) -> None:
        """Speed and load of one scan."""
        self._speed.append(speed)
        self._load.append(load_n)

    def clear(self) -> None:
        """Forget which blocks were raised."""
        self._raised.clear()

    def step(self, axes: Sequence[str], std: Sequence[float]) -> str | None:
        """The axis that raises the alarm with this block, or None."""
        point = OperatingPoint(_rms(self._speed), _rms(self._load))
        alarm = None
        for axis, level in zip(axes, std, strict=True):
            nominal = self._levels.get(axis)
            if nominal is None:
                continue
            high = nominal.at(point)[1]
            recent = self._raised.setdefault(axis, deque(maxlen=BLOCKS))
            recent.append(bool(level > high))
            if sum(recent) >= RAISED:
                alarm = alarm or axis
        return alarm


def _rms(values: Sequence[float]) -> float:
    return math.sqrt(sum(v * v for v in values) / len(values)) if values else math.nan
