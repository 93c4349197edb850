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

"""How a size of the fault of an episode goes while the stand runs: one size every 20 s of it.

Beside the isolator, which fits all of an episode at once: a size over all of it lags behind a fault
that grows. The sizes of one unit share what it differs by, as those of recordings do (``flea
trend``), and growth is told by their own errors alone.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from flea_diag.core.prognosis.forecast import Forecast, forecast
from flea_diag.core.prognosis.size_series import SizeSeries
from flea_diag.core.prognosis.trend import Trend, trend
from flea_diag.errors import ConfigurationError
from flea_diag.stages.isolator.parameters import Knowledge
from flea_diag.stages.sizes.recording_sizes import RecordingSize, RecordingSizes
from flea_diag.wire.blocks import ResidualBlock, block_of
from flea_diag.wire.records import (
    NEVER_NS,
    AmbiguityGroup,
    Outcome,
    Record,
    Residual,
    SizeAt,
    SizeTrend,
)

Records = tuple[Record, ...]

FOLLOWED = (Outcome.ISOLATED, Outcome.INDISTINGUISHABLE)
"""Outcomes whose most probable fault with a size is followed."""
FROM_S = 3.0
"""After the verdict: longer than the isolator holds records back for those of other topics."""
EACH_S = 20.0
"""Of the motion of one size at first: some pieces by whose scatter its error is known."""
MOST_KEPT = 64
"""Sizes that are kept; then each two become one, and each further one takes twice as long."""
LATER_NS = 2**62
"""Latest stamp that is foretold; what comes later never comes."""


class SizeWatch:
    """Takes residuals and verdicts; returns a ``SizeTrend`` with each new size."""

    consumes: tuple[type, ...] = (Residual, AmbiguityGroup)
    takes_blocks = True

    def __init__(self, knowledge: Knowledge) -> None:
        self._k = knowledge
        self._latest: ResidualBlock | None = None
        """A verdict comes after the block of its evidence, which may go on beyond it."""
        self.reset()

    def reset(self) -> Records:
        """Nothing is followed any more."""
        self._fault, self._episode = "", 0
        self._sizes: RecordingSizes | None = None
        return ()

    def handle(self, record: Record) -> Records:
        """Take one residual or verdict."""
        if isinstance(record, AmbiguityGroup):
            return self._follow(record)
        assert isinstance(record, Residual)
        self._latest = None
        return self._add(block_of(record)) if self._sizes is not None else ()

    def handle_block(self, block: ResidualBlock) -> tuple[int, Records]:
        """Take n residuals."""
        self._latest = block
        return len(block), self._add(block) if self._sizes is not None else ()

    def _follow(self, group: AmbiguityGroup) -> Records:
        if group.outcome not in FOLLOWED or group.comes_and_goes:
            return self.reset()
        sized = [member.fault for member in group.members if math.isfinite(member.size)]
        if self._episode == group.episode and self._fault in sized:
            return ()
        self.reset()
        if sized:
            self._begin(sized[0], group)
        return self._add(self._latest) if self._sizes is not None and self._latest else ()

    def _begin(self, fault: str, group: AmbiguityGroup) -> None:
        try:
            self._sizes = RecordingSizes(self._k, fault)
        except ConfigurationError:
            return  # its size is that of a feature
        self._fault, self._episode = fault, group.episode
        self._each_ns = round(EACH_S * 1e9)
        self._next_ns = group.stamp_ns + round(FROM_S * 1e9) + self._each_ns
        self._of: RecordingSize | None = None
        self._middles_ns: list[int] = []
        self._series: SizeSeries | None = None
        self._sizes.begin()

    def _add(self, block: ResidualBlock) -> Records:
        assert self._sizes is not None
        said: list[Record] = []
        late = block.stamps_ns > self._next_ns - self._each_ns
        block = block.part(slice(int(late.argmax()) if late.any() else len(block), None))
        while len(block):
            inside = int(np.searchsorted(block.stamps_ns, self._next_ns))
            if inside:
                self._sizes.add(block.part(slice(inside)))
            if inside == len(block):
                break
            said += self._over(int(block.stamps_ns[inside]))
            block = block.part(slice(inside, None))
        return tuple(said)

    def _over(self, stamp_ns: int) -> Records:
        """The time of one size is over; where nothing moved there is none."""
        assert self._sizes is not None
        middle_ns = self._next_ns - self._each_ns // 2
        found = self._chosen(self._sizes.sizes())
        self._sizes.begin()
        while self._next_ns <= stamp_ns:
            self._next_ns += self._each_ns
        if found is None:
            return ()
        self._of = found
        self._middles_ns.append(middle_ns)
        last = SizeSeries.of([0.0], [found.size], [found.error])
        self._series = last if self._series is None else _joined(self._series, last)
        if len(self._series) > MOST_KEPT:
            self._series = self._halved(self._series)
        return (self._told(stamp_ns, self._series),)

    def _chosen(self, sizes: tuple[RecordingSize, ...]) -> RecordingSize | None:
        """That with a limit, else the one that is known best; the same from the first on."""
        if self._of is not None:
            return next((row for row in sizes if row.of.name == self._of.of.name), None)
        limited = [row for row in sizes if math.isfinite(row.of.limit)]
        known = lambda row: abs(row.size) / row.error.total  # noqa: E731
        return max(limited or sizes, key=known, default=None)

    def _halved(self, s: SizeSeries) -> SizeSeries:
        """Each two neighbours become their mean, weighed by their own errors."""
        even = len(s) // 2 * 2
        weights = np.square(1.0 / s.own[:even]).reshape(-1, 2)
        total = weights.sum(axis=1)
        weights = weights / total[:, None]
        stamps = np.array(self._middles_ns[:even]).reshape(-1, 2)
        halved = SizeSeries(
            np.zeros(even // 2),
            (weights * s.sizes[:even].reshape(-1, 2)).sum(axis=1),
            1.0 / np.sqrt(total),
            np.einsum("kt,ktd->kd", weights, s.from_unit[:even].reshape(even // 2, 2, -1)),
        )
        self._middles_ns = [
            *(stamps[:, 0] + np.rint(weights[:, 1] * np.diff(stamps)[:, 0]).astype(int)).tolist(),
            *self._middles_ns[even:],
        ]
        self._next_ns += self._each_ns  # of the one that has just begun
        self._each_ns *= 2
        return _joined(halved, s.part(slice(even, None)))

    def _told(self, stamp_ns: int, series: SizeSeries) -> SizeTrend:
        assert self._of is not None
        start_ns, size = self._middles_ns[0], self._of.of
        times = (np.array(self._middles_ns) - start_ns) / 1e9
        series = replace(series, times=times)
        line = trend(series)
        told = SizeTrend(
            stamp_ns,
            self._episode,
            self._fault,
            size.name,
            size.unit,
            tuple(map(SizeAt, self._middles_ns, series.sizes.tolist(), series.own.tolist())),
            *_level(line, float(times[-1])),
            line.direction,
            line.slope,
            line.slope_sigma,
            size.limit if math.isfinite(size.limit) else math.nan,
        )
        grows = line.direction == "grows" and math.isfinite(size.limit)
        found = forecast(series) if grows else None
        return told if found is None else _with_crossing(told, found, start_ns)


def _joined(first: SizeSeries, second: SizeSeries) -> SizeSeries:
    return SizeSeries(
        *(
            np.concatenate((getattr(first, name), getattr(second, name)))
            for name in ("times", "sizes", "own", "from_unit")
        )
    )


def _level(line: Trend, at_s: float) -> tuple[float, float]:
    """The line at a time, and its standard error; without a slope its level."""
    if math.isnan(line.slope):
        return line.level, line.level_sigma
    since_s = at_s - line.middle
    return line.level + line.slope * since_s, math.hypot(
        line.level_sigma, line.slope_sigma * since_s
    )


def _with_crossing(told: SizeTrend, found: Forecast, start_ns: int) -> SizeTrend:
    """With when the limit is reached."""
    crossing = found.crossing(told.limit)

    def stamp(time_s: float) -> int:
        stamp_ns = start_ns + time_s * 1e9
        return round(stamp_ns) if stamp_ns < LATER_NS else NEVER_NS

    return replace(
        told,
        low_ns=stamp(crossing.low_s),
        median_ns=stamp(crossing.median_s),
        high_ns=stamp(crossing.high_s),
        crossed=crossing.crossed,
        never=crossing.never,
    )
