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

"""Recent motion of the actuator: speed, load and the quadrants visited."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Sequence

from flea_diag.core.causal_graph.operating_point import Quadrant
from flea_diag.core.likelihood.effect_set import EffectSet
from flea_diag.core.residuals.relation_set import DIRECTION
from flea_diag.core.scan_counts import ScanCounts
from flea_diag.core.vibration.vibration_monitor import SCANS, VibrationMonitor
from flea_diag.stages.isolator.motion_window import MotionWindow
from flea_diag.wire.blocks import ResidualBlock

SPEED, MOVING = -2, -1
"""Columns of the regressors, from the last."""
VISITED_S = 4.0
"""Time in motion over which visited quadrants are kept."""
IDLE_A = 0.1
"""Below this the sign of a current is noise."""


class MotionHistory:
    """Follows the regressors of every scan; constant memory.

    Parameters
    ----------
    encoder_m_per_rad : travel of the nut, 0 where no speed of the shaft is known
    window_ns : length of ``window``
    monitor : receives speed and load of each scan
    effects : whose basis signals are the first regressors
    counts : of scans at the rate of the stand
    """

    def __init__(
        self,
        encoder_m_per_rad: float,
        window_ns: int,
        monitor: VibrationMonitor,
        effects: EffectSet,
        counts: ScanCounts,
    ) -> None:
        current, load, _, _ = effects.residuals.followed
        self._load, self._current, self._direction = map(
            effects.names.index, (load, current, DIRECTION)
        )
        self._lead = encoder_m_per_rad
        self._monitor = monitor
        self._most_visited = counts.of(VISITED_S)
        self._visited: deque[tuple[float, float]] = deque(maxlen=self._most_visited)
        self.window = MotionWindow(window_ns)

    def step(self, stamp_ns: int, regressors: Sequence[float], moving: bool) -> None:
        """Take one scan."""
        screw_rad_s, load_n = self._screw_rad_s(regressors[SPEED]), regressors[self._load]
        self.window.add(stamp_ns, screw_rad_s, load_n)
        self._monitor.motion(screw_rad_s, load_n)
        if moving:
            self._visited.append((regressors[self._current], regressors[self._direction]))

    def follow(self, block: ResidualBlock) -> None:
        """Take many scans, of which only the last are kept."""
        moving = block.regressors[:, MOVING] > 0.5
        visited = block.regressors[:, [self._current, self._direction]][moving]
        self._visited.extend(map(tuple, visited[-self._most_visited :].tolist()))
        recent = int((block.stamps_ns > block.stamps_ns[-1] - self.window.history_ns).sum())
        last = slice(-max(recent, SCANS), None)
        speeds = [self._screw_rad_s(speed) for speed in block.regressors[last, SPEED].tolist()]
        loads_n = block.regressors[last, self._load].tolist()
        self.window.extend(zip(block.stamps_ns[last].tolist(), speeds, loads_n, strict=True))
        for screw_rad_s, load_n in zip(speeds[-SCANS:], loads_n[-SCANS:], strict=True):
            self._monitor.motion(screw_rad_s, load_n)

    def _screw_rad_s(self, speed_m_s: float) -> float:
        return speed_m_s / self._lead if self._lead else math.nan

    @property
    def is_whole(self) -> bool:
        """Whether scans in motion are known for as far back as they count."""
        return len(self._visited) == self._most_visited

    def quadrants(self) -> set[Quadrant]:
        """Quadrants visited by the last scans in motion."""
        return {quadrant for scan in self._visited for quadrant in _quadrants(*scan)}


def _quadrants(current_a: float, direction: float) -> tuple[Quadrant, ...]:
    """Quadrants of a scan; a current within its noise counts with both signs."""
    if not math.isfinite(current_a):
        return ()
    signs = (-1, 1) if abs(current_a) < IDLE_A else (1 if current_a > 0 else -1,)
    return tuple(Quadrant(sign, 1 if direction > 0 else -1) for sign in signs)
