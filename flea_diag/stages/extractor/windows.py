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

"""Windows of vibration with the simultaneous motion, cut from the two rings."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from flea_diag.core.vibration.nominal_range import VibrationOperatingPoint
from flea_diag.core.vibration.window import NotComputableError, Window
from flea_diag.stages.extractor.scan_ring import ScanRing, interpolated
from flea_diag.stages.extractor.vibration_ring import VibrationRing
from flea_diag.wire.records import SECOND_NS, Scan, VibrationBlock


class Windows:
    """The last seconds of a stand, from which any window can be cut.

    Parameters
    ----------
    history_s : length of the history
    gap_limit_s, scan_gap_limit_s : longest gap of blocks and of scans inside a window
    orders : ball-pass orders, handed on to the features
    """

    def __init__(
        self,
        history_s: float,
        gap_limit_s: float,
        scan_gap_limit_s: float,
        orders: Mapping[str, float],
    ) -> None:
        self.vibration = VibrationRing(history_s, gap_limit_s)
        self.scans = ScanRing(history_s, scan_gap_limit_s)
        self.orders = orders

    def add(self, record: Scan | VibrationBlock) -> bool:
        """Store one record; False if it cannot be used."""
        if isinstance(record, Scan):
            return self.scans.add(record)
        return self.vibration.add(record) is not None

    def covers(self, end_ns: int) -> bool:
        """Whether both streams have reached ``end_ns``.

        A stream that was never received is ignored.
        """
        vibration_ns, scan_ns = self.vibration.end_ns, self.scans.end_ns
        return (vibration_ns < 0 or vibration_ns >= end_ns - self.vibration.gap_limit_ns) and (
            scan_ns < 0 or scan_ns >= end_ns
        )

    def operating_point(self, start_ns: int, end_ns: int) -> VibrationOperatingPoint:
        """Root mean square of speed and load over a window."""
        return self.scans.operating_point(start_ns, end_ns)

    def motion(self, start_ns: int, end_ns: int) -> Window:
        """Window of the scans only, without vibration."""
        slow, times_s = self.scans.columns(start_ns, end_ns)
        return Window(np.empty((0, 0)), 1.0, (), None, slow, times_s)

    def cut(
        self, start_ns: int, end_ns: int, accelerometer: str = "", with_motion: bool = True
    ) -> Window:
        """Decode one window, of one accelerometer or of all.

        Raises
        ------
        NotComputableError
            Vibration does not cover the window; the message is the reason.
        """
        columns = self._columns(accelerometer)
        stretch = self.vibration.cut(start_ns, end_ns, columns)
        window = Window(
            stretch.samples,
            stretch.rate_hz,
            stretch.axes,
            orders=self.orders,
            start_s=(stretch.start_ns - start_ns) / SECOND_NS,
        )
        return self.moved(window, start_ns, end_ns) if with_motion else window

    def moved(self, window: Window, start_ns: int, end_ns: int) -> Window:
        """Add the motion to a window that was cut without it."""
        sample_times_s = window.start_s + np.arange(window.count) / window.rate_hz
        slow, times_s = self.scans.columns(start_ns, end_ns)
        speed = slow.get("motor_speed", np.empty(0))
        at_samples = interpolated(speed, times_s, sample_times_s, self.scans.gap_limit_s)
        return window.moved(at_samples, slow, times_s - window.start_s)

    def _columns(self, accelerometer: str) -> tuple[int, ...]:
        axes = self.vibration.axes
        prefix = f"{accelerometer}_" if accelerometer else ""
        columns = tuple(k for k, axis in enumerate(axes) if axis.startswith(prefix))
        if not axes:
            raise NotComputableError("no vibration was received")
        if not columns:
            raise NotComputableError(
                f"the stream has no axis of {accelerometer}, only {', '.join(axes)}"
            )
        return columns
