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

"""Status of one stream as received by a screen: rate, late, missing, stale.

Rate, late and missing are computed from the stamps of the records, stale from their arrival.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

from flea_diag.wire.records import (
    NEVER_NS,
    AmbiguityGroup,
    ChannelTable,
    Health,
    Record,
    Residual,
    Scan,
    VibrationLevel,
)
from flea_diag.wire.topics import TOPIC_OF

STALE_AFTER_NS: dict[type, int] = {
    Scan: 1_000_000_000,
    Residual: 1_000_000_000,
    VibrationLevel: 1_000_000_000,
    AmbiguityGroup: 2_500_000_000,
    Health: 3_500_000_000,
}
"""Continuous streams -> time without a record after which they are stale. Verdict and health are
published every second: with two missing in a row their publisher has stopped."""

RATE_OVER_NS = 1_000_000_000
AXIS = "accelerometer"
"""Prefix of the channels in vibration blocks; all others are in scans."""
JUMP_NS = 1_000_000_000
"""Step back of the stamps from which on a new run is assumed."""


@dataclass(frozen=True, slots=True)
class StreamState:
    """Counters of one topic; ``missing`` counts records absent from the sequence of stamps.

    ``rate_hz`` is NaN during the first second of stamps. ``lost`` is reported by the middleware of
    any node.
    """

    name: str
    stale_after_ns: int
    received: int = 0
    late: int = 0
    missing: int = 0
    lost: int = 0
    rate_hz: float = math.nan
    stamp_ns: int = NEVER_NS
    arrived_ns: int = NEVER_NS
    since_ns: int = NEVER_NS
    counted: int = 0

    def silent_s(self, now_ns: int) -> float:
        """Seconds since the last record; infinite before the first."""
        return math.inf if self.arrived_ns == NEVER_NS else (now_ns - self.arrived_ns) / 1e9

    def standing(self, now_ns: int) -> str:
        """One of ``waiting`` (no record yet), ``stale`` and ``running``."""
        if self.arrived_ns == NEVER_NS:
            return "waiting"
        return "stale" if now_ns - self.arrived_ns > self.stale_after_ns else "running"


def streams() -> dict[str, StreamState]:
    """Initial state of the monitored streams."""
    names = {kind: TOPIC_OF[kind].name.lstrip("/") for kind in STALE_AFTER_NS}
    return {names[kind]: StreamState(names[kind], limit) for kind, limit in STALE_AFTER_NS.items()}


def jumped_back(stream: StreamState, stamp_ns: int) -> bool:
    """Whether a stamp belongs to a new run (a looping replay, a restarted stand)."""
    return stamp_ns < stream.stamp_ns - JUMP_NS


def counted(
    stream: StreamState, record: Record, arrived_ns: int, period_ns: int = 0
) -> StreamState:
    """State after one more record; ``period_ns`` is the nominal period, 0 where unknown."""
    stamp_ns = record.stamp_ns
    if stamp_ns <= stream.stamp_ns and not isinstance(record, AmbiguityGroup | Health):
        late = stream.late + 1
        return replace(stream, received=stream.received + 1, late=late, arrived_ns=arrived_ns)
    missing = stream.missing
    if period_ns and stream.stamp_ns != NEVER_NS:
        missing += max(0, round((stamp_ns - stream.stamp_ns) / period_ns) - 1)
    rate_hz, since_ns, count = stream.rate_hz, stream.since_ns, stream.counted + 1
    if since_ns == NEVER_NS:
        since_ns, count = stamp_ns, 0
    elif stamp_ns - since_ns >= RATE_OVER_NS:
        rate_hz, since_ns, count = count * 1e9 / (stamp_ns - since_ns), stamp_ns, 0
    return StreamState(
        stream.name,
        stream.stale_after_ns,
        stream.received + 1,
        stream.late,
        missing,
        stream.lost,
        rate_hz,
        stamp_ns,
        arrived_ns,
        since_ns,
        count,
    )


def scan_period_ns(table: ChannelTable | None) -> int:
    """Nominal period of the scans by the channel table; 0 where it gives no rate."""
    slow = [row for row in table.channels if not row.name.startswith(AXIS)] if table else []
    rate_hz = max((row.rate_hz for row in slow), default=0.0)
    return round(1e9 / rate_hz) if rate_hz > 0.0 else 0
