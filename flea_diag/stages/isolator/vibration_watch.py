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

"""Pairs vibration levels with the motion of the same time for the vibration monitor.

The smoothed speed of a block's time is known half a smoothing kernel after the block. Each block
waits for it; a block whose speed never arrives was recorded while no observer was running.
"""

from __future__ import annotations

from collections import deque

from flea_diag.core.vibration.nominal_range import NominalRanges
from flea_diag.core.vibration.vibration_monitor import VibrationAlarm, VibrationMonitor
from flea_diag.wire.records import VibrationLevel

LEVEL_DELAY_NS = 150_000_000
"""Delay of the smoothed speed behind the end of a block: half a kernel."""
LATEST_NS = 2 * LEVEL_DELAY_NS
"""A block that waits longer is discarded: its speed never arrived."""


class VibrationWatch:
    """The vibration monitor of one stand, and the levels that still wait for their motion.

    Attributes
    ----------
    monitor
        Receives speed and load of each scan.
    """

    def __init__(self, nominal: NominalRanges) -> None:
        self.monitor = VibrationMonitor(nominal)
        self._levels: deque[VibrationLevel] = deque(maxlen=100)

    def add(self, level: VibrationLevel) -> None:
        """Add the levels of one block."""
        self._levels.append(level)

    @property
    def waits(self) -> bool:
        """Whether a block waits for its motion."""
        return bool(self._levels)

    def alarm(self, stamp_ns: int) -> VibrationAlarm | None:
        """The alarm raised by the block whose motion is known with this scan, or None."""
        if not self._levels or self._levels[0].stamp_ns + LEVEL_DELAY_NS > stamp_ns:
            return None
        level = self._levels.popleft()
        if stamp_ns - level.stamp_ns > LATEST_NS:
            return None
        return self.monitor.step(level.axes, level.std, level.kurtosis)
