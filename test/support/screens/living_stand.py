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

"""A stand that lives in this process: it fills a desk until it is told to die."""

from __future__ import annotations

import math
import threading
import time
from dataclasses import replace

from flea_diag.nodes.operator.desk import Desk
from flea_diag.wire.records import (
    AmbiguityGroup,
    ChannelInfo,
    ChannelQuality,
    ChannelTable,
    DataQuality,
    Quality,
    Record,
    Residual,
    Scan,
    VibrationLevel,
)

CHANNELS = (("motor_current", "A"), ("motor_speed", "rad/s"), ("load_force", "N"))
RESIDUALS = ("parity_mechanical", "parity_electrical", "motor_current_stuck", "load_position")
LIMITS = (6.0, 5.0, 50.0, 1.0)
EVERY_S = 0.05
VERDICT_EVERY = 10


class LivingStand:
    """What arrives is up to the test; scans, residuals and the last verdict come by themselves."""

    def __init__(self, desk: Desk) -> None:
        self.desk = desk
        self.verdict: AmbiguityGroup | None = None
        self.z = (0.0, 4.7e-16, 0.0, 0.05)
        self.lives = threading.Event()
        self._lock = threading.Lock()
        self._ended = threading.Event()
        self._thread = threading.Thread(target=self._live, daemon=True)

    def take(self, *records: Record) -> None:
        """Records that arrive now; a verdict is repeated from then on."""
        with self._lock:
            for record in records:
                if isinstance(record, AmbiguityGroup):
                    self.verdict = record
                self.desk.take(record)

    def _repeat(self, count: int) -> None:
        """The last verdict once more, and none that another has just followed."""
        with self._lock:
            if self.verdict is not None:
                self.desk.take(replace(self.verdict, seq=count, stamp_ns=time.time_ns()))

    def tell_channels(self, lost: int = 0) -> None:
        """The table of channels, and that all of them are good."""
        now_ns = time.time_ns()
        rows = tuple(ChannelInfo(n, u, -9.0, 9.0, 1.0 / EVERY_S) for n, u in CHANNELS)
        names = ("sensors/slow", *(name for name, _ in CHANNELS))
        counters = {"sensors/slow": (("samples", 9000), ("lost", lost))}
        quality = (ChannelQuality(n, Quality.GOOD, now_ns, "", counters.get(n, ())) for n in names)
        self.take(ChannelTable(now_ns, "bay", rows), DataQuality(now_ns, tuple(quality)))

    def start(self) -> None:
        """Begin to live."""
        self.lives.set()
        self._thread.start()

    def _live(self) -> None:
        count = 0
        while not self._ended.wait(EVERY_S):
            if not self.lives.is_set():
                continue
            now_ns, count = time.time_ns(), count + 1
            swing = tuple(math.sin(count / 10.0 + k) for k in range(len(CHANNELS)))
            self.desk.take(Scan(now_ns, tuple(name for name, _ in CHANNELS), swing))
            self.desk.take(Residual(now_ns, RESIDUALS, (0.0,) * 4, self.z, LIMITS))
            self.desk.take(VibrationLevel(now_ns, ("accelerometer_1_x",), (0.5,), (3.0,)))
            if count % VERDICT_EVERY == 0:
                self._repeat(count)
            self.desk.tick()

    def close(self) -> None:
        """End."""
        self._ended.set()
        if self._thread.is_alive():
            self._thread.join()
