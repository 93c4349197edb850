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

"""What sources do to their own readings: each row a way in which valid messages mislead."""

from __future__ import annotations

import math
import random
from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from flea_diag.wire.records import Scan
from support.graph.runs import PERIOD_NS, Run

Random = random.Random
Scans = list[Scan]


def _without(scan: Scan, columns: Sequence[int]) -> Scan:
    values = list(scan.values)
    for column in columns:
        values[column] = math.nan
    return replace(scan, values=tuple(values))


def _column(scans: Scans, draw: Random) -> int:
    return draw.randrange(len(scans[0].channels))


def nan_regularly(scans: Scans, draw: Random) -> Scans:
    """One reading in 33 of a channel is missing."""
    column = _column(scans, draw)
    return [_without(s, [column]) if k % 33 == 0 else s for k, s in enumerate(scans)]


def nan_at_random(scans: Scans, draw: Random) -> Scans:
    """3, 5, 10 or 30 % of all readings are missing."""
    share, width = draw.choice((0.03, 0.05, 0.1, 0.3)), len(scans[0].channels)
    return [_without(s, [c for c in range(width) if draw.random() < share]) for s in scans]


def slow_channel(scans: Scans, draw: Random) -> Scans:
    """One channel comes at half the rate."""
    column = _column(scans, draw)
    return [_without(s, [column]) if k % 2 else s for k, s in enumerate(scans)]


def lost_regularly(scans: Scans, draw: Random) -> Scans:
    """10 of 32 scans are lost."""
    return [s for k, s in enumerate(scans) if k % 32 < 22]


def empty_scans(scans: Scans, draw: Random) -> Scans:
    """Each 20th scan holds nothing."""
    columns = range(len(scans[0].channels))
    return [_without(s, columns) if k % 20 == 0 else s for k, s in enumerate(scans)]


def other_rate(scans: Scans, draw: Random) -> Scans:
    """The source samples at another rate than the calibration's."""
    return sampled(scans, draw.choice((50.0, 80.0, 95.0, 99.0, 105.0, 120.0)))


def sampled(scans: Scans, rate_hz: float) -> Scans:
    """The same motion at a rate."""
    period_ns = round(1e9 / rate_hz)
    own_ns = np.array([s.stamp_ns for s in scans])
    stamps_ns = np.arange(own_ns[0], own_ns[-1], period_ns)
    readings = np.array([s.values for s in scans])
    columns = [np.interp(stamps_ns, own_ns, each) for each in readings.T]
    rows = zip(stamps_ns.tolist(), np.transpose(columns).tolist(), strict=True)
    return [Scan(stamp_ns, scans[0].channels, tuple(row)) for stamp_ns, row in rows]


def jitter(scans: Scans, draw: Random) -> Scans:
    """Stamps scatter by 1 to 3 ms."""
    sigma_ns = draw.uniform(1e6, 3e6)
    return [replace(s, stamp_ns=s.stamp_ns + round(draw.gauss(0.0, sigma_ns))) for s in scans]


def clock_set_back(scans: Scans, draw: Random) -> Scans:
    """The clock of the stamps steps back, by 6 ms to 1 s."""
    at = draw.randrange(len(scans) // 4, 3 * len(scans) // 4)
    back_ns = draw.randrange(6_000_000, 1_000_000_000)
    return [replace(s, stamp_ns=s.stamp_ns - back_ns * (k >= at)) for k, s in enumerate(scans)]


def stopped(scans: Scans, draw: Random) -> Scans:
    """The source stands still for a while."""
    at, length = draw.randrange(len(scans) // 4, len(scans) // 2), draw.randrange(100, 600)
    return [*scans[:at], *scans[at + length :]]


def twice(scans: Scans, draw: Random) -> Scans:
    """A tenth of the scans comes twice."""
    return [s for s in scans for _ in range(1 + (draw.random() < 0.1))]


def overtaken(scans: Scans, draw: Random) -> Scans:
    """A third of the scans is overtaken by the next ones."""
    places = [
        k + (draw.uniform(0.0, 4.0) if draw.random() < 0.3 else 0.0) for k in range(len(scans))
    ]
    return [scans[k] for k in sorted(range(len(scans)), key=places.__getitem__)]


SPOILT: dict[str, Callable[[Scans, Random], Scans]] = {
    each.__name__: each
    for each in (
        nan_regularly, nan_at_random, slow_channel, lost_regularly, empty_scans, other_rate,
        jitter, clock_set_back, stopped, twice, overtaken,
    )
}  # fmt: skip


def sent(run: Run, names: Sequence[str], draw: Random) -> list[tuple[int, Scan]]:
    """Scans in the order in which they are sent, with the times of sending.

    A source sends at its own pace, whatever it writes into the stamps.
    """
    scans = list(run.scans)
    for name in names:
        scans = SPOILT[name](scans, draw)
    first = run.scans[0].stamp_ns
    if "clock_set_back" not in names and "overtaken" not in names:
        return [(max(s.stamp_ns - first, 0), s) for s in scans]
    return [(k * PERIOD_NS, s) for k, s in enumerate(scans)]
