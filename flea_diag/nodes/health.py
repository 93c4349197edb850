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

"""Health of a node itself, not of the actuator: at 1 Hz on /diagnostics (REP-107)."""

from __future__ import annotations

import math
import os
import time
from typing import Any

from flea_diag.nodes.stamp_clock import StampClock
from flea_diag.wire.bus import Bus
from flea_diag.wire.records import Health, Level, Scan
from flea_diag.wire.topics import TOPIC_OF

SILENT_AFTER_S = 0.6
"""Silence after which the source is stale. With a check every 0.1 s it is reported within 1 s."""

LONGEST_TURN_S = 0.2
"""Most that one check counts as silence: in a longer time this node itself was held up, and what
the source said meanwhile waits to be read."""

MOST_DRIFT_PPM = 500.0
"""Of the stamps against this machine's clock: ten times what two quartz clocks differ by."""

PAGE_BYTES = os.sysconf("SC_PAGE_SIZE")


class HealthReport:
    """Counts received, late and skipped messages; measures lag, CPU and memory."""

    def __init__(self, bus: Bus[Any]) -> None:
        self._bus = bus
        self._late: dict[type, int] = {}
        self._last_taken_s: float | None = None
        self._silent_s, self._checked_s = 0.0, time.monotonic()
        self._worst_lag_ns = 0
        self._clock = StampClock()
        self._reported_passed_over = 0
        self._cpu_s, self._wall_s = time.process_time(), time.monotonic()

    @property
    def waiting(self) -> bool:
        """Whether no record of a stream has been taken yet."""
        return self._last_taken_s is None

    @property
    def silent(self) -> bool:
        """Whether a stream that was running has stopped."""
        return self._last_taken_s is not None and self._silent_s > SILENT_AFTER_S

    @property
    def silent_s(self) -> float:
        """Time since a record of the stream was accepted."""
        return 0.0 if self._last_taken_s is None else time.monotonic() - self._last_taken_s

    def check(self) -> None:
        """Count the time since the last check as silence, unless a record is taken after it."""
        now_s = time.monotonic()
        self._silent_s += min(now_s - self._checked_s, LONGEST_TURN_S)
        self._checked_s = now_s

    def arrived(self, record_type: type, stamp_ns: int, late: bool) -> None:
        """Count a record of a stream; ``late`` when a newer one arrived before it.

        A latched record has no lag: a late subscriber receives it at any age.
        """
        if not TOPIC_OF[record_type].latched:
            self._worst_lag_ns = max(self._worst_lag_ns, self._bus.now_ns() - stamp_ns)
        if record_type is Scan:
            self._clock.arrived(stamp_ns, time.monotonic_ns())
        if late:
            self._late[record_type] = self._late.get(record_type, 0) + 1

    def taken(self) -> None:
        """Note that a record of the stream was accepted: its source is running."""
        self._last_taken_s = self._checked_s = time.monotonic()
        self._silent_s = 0.0

    def record(self, extra: tuple[tuple[str, str], ...] = ()) -> Health:
        """Report for the time since the previous report, followed by the key/values ``extra``."""
        passed_over = sum(
            stream.malformed + stream.refused + stream.lost for stream in self._bus.streams.values()
        )
        level, message = self._judged(passed_over)
        state = ("state", self._bus.state)
        values = (state, *self._stream_values(), *self._machine_values(), *extra)
        self._reported_passed_over = passed_over
        if self._bus.replays:
            level = Level.OK
        return Health(self._bus.now_ns(), self._bus.name, level, message, values)

    def _judged(self, passed_over: int) -> tuple[Level, str]:
        new = passed_over - self._reported_passed_over
        if self._last_taken_s is None:
            return Level.WARN, "waiting for the first record"
        if self.silent:
            words = f"no record for {self.silent_s:.0f} s: check that the source is running"
            return Level.WARN, words
        if new > 0:
            return Level.WARN, f"{new} messages skipped or lost since the last report"
        if abs(self._clock.drift_ppm) > MOST_DRIFT_PPM and not self._bus.replays:
            slow = "slower" if self._clock.drift_ppm > 0.0 else "faster"
            return Level.WARN, (
                f"the clock of the stamps is {abs(self._clock.drift_ppm):.0f} ppm {slow} than this "
                "machine's: set one by the other, or have the source stamp by its samples"
            )
        return Level.OK, "running"

    def _stream_values(self) -> tuple[tuple[str, str], ...]:
        return tuple(
            (f"{stream.topic.name.lstrip('/')}/{counter}", str(count))
            for record_type, stream in self._bus.streams.items()
            for counter, count in (
                ("received", stream.received),
                ("late", self._late.get(record_type, 0)),
                ("malformed", stream.malformed),
                ("refused", stream.refused),
                ("lost", stream.lost),
                *((("foreign", stream.foreign),) if stream.foreign else ()),
            )
        )

    def _machine_values(self) -> tuple[tuple[str, str], ...]:
        cpu_s, wall_s = time.process_time(), time.monotonic()
        percent = 100.0 * (cpu_s - self._cpu_s) / max(wall_s - self._wall_s, 1e-9)
        lag_ms, drift = self._worst_lag_ns / 1e6, self._clock.drift_ppm
        self._cpu_s, self._wall_s, self._worst_lag_ns = cpu_s, wall_s, 0
        return (
            ("worst_lag_ms", f"{lag_ms:.1f}"),
            *((("stamp_drift_ppm", f"{drift:.0f}"),) if math.isfinite(drift) else ()),
            ("cpu_percent", f"{percent:.1f}"),
            ("memory_mb", f"{_resident_bytes() / 1e6:.0f}"),
        )


def _resident_bytes() -> int:
    with open("/proc/self/statm", encoding="ascii") as statm:
        return int(statm.read().split()[1]) * PAGE_BYTES
