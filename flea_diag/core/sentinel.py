"""Always-on watch of the vibration level, for faults that no slow channel shows (spall).

A level is held against its nominal range at the operating point of the block. ``RAISED`` of
the last ``BLOCKS`` blocks on the same side of the range raise the alarm: above it something
shakes, below it a sensor is dying. One loud block does not. Blocks in motion and at rest are
counted apart: a pit is heard in motion alone, however long the actuator rests in between.
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
        self._levels = {True: nominal.levels, False: nominal.resting_levels}
        self._speed: deque[float] = deque(maxlen=SCANS)
        self._load: deque[float] = deque(maxlen=SCANS)
        self._sides: dict[tuple[str, bool], deque[int]] = {}
        self._judged: dict[str, tuple[bool, float, float, float]] = {}

    def motion(self, speed: float, load_n: float) -> None:
        """Speed and load of one scan."""
        self._speed.append(speed)
        self._load.append(load_n)

    def clear(self) -> None:
        """Forget which blocks were out of their range."""
        self._sides.clear()

    def step(self, axes: Sequence[str], std: Sequence[float]) -> str | None:
        """The axis that raises the alarm with this block, or None."""
        point = OperatingPoint(_rms(self._speed), _rms(self._load))
        moving = point.moving
        alarm = None
        for axis, level in zip(axes, std, strict=True):
            nominal = self._levels[moving].get(axis)
            if nominal is None:
                continue
            low, high = nominal.at(point)
            self._judged[axis] = moving, level, low, high
            recent = self._sides.setdefault((axis, moving), deque(maxlen=BLOCKS))
            recent.append(int(level > high) - int(level < low))
            if max(recent.count(1), recent.count(-1)) >= RAISED:
                alarm = alarm or axis
        return alarm

    def side(self, axis: str) -> str:
        """``+`` where the level of an axis in its last blocks is above its range, else ``-``."""
        recent = self._sides[axis, self._judged[axis][0]]
        return "+" if sum(recent) > 0 else "-"

    def words(self, axis: str) -> str:
        """Level of an axis in its last block against its range, and how often it left that."""
        moving, level, low, high = self._judged[axis]
        recent = self._sides[axis, moving]
        out = max(recent.count(1), recent.count(-1))
        return (
            f"{axis}: level {level:.3g} m/s^2, nominal {low:.3g} to {high:.3g}, outside in {out} "
            f"of the last {len(recent)} blocks {'in motion' if moving else 'at rest'}"
        )


def _rms(values: Sequence[float]) -> float:
    return math.sqrt(sum(v * v for v in values) / len(values)) if values else math.nan
