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

"""How the size of the fault goes while the stand runs, and when it will reach its limit."""

from __future__ import annotations

import math
from collections.abc import Iterator

from flea_diag.operator.panel import Line, Panel, clock
from flea_diag.operator.quantity import number
from flea_diag.operator.state import OPEN, OperatorState
from flea_diag.operator.words import later, tr
from flea_diag.wire.records import NEVER_NS, Level, SizeTrend

MOST_SIZES = 6
MINUTE_S = 60.0
MORE_LIKELY = 0.5
DIRECTIONS = (later("grows"), later("shrinks"), later("no trend is shown"))
"""Words of ``core/prognosis/trend.py``."""


def followed(state: OperatorState) -> SizeTrend | None:
    """Of the open episode; None while it has no size yet, or another episode is open."""
    trend, group = state.trend, state.group
    if trend is None or group is None or group.outcome not in OPEN:
        return None
    return trend if trend.episode == group.episode else None


def growth(state: OperatorState) -> Panel | None:
    """Sizes over time, the latest last, with their growth and what it leads to."""
    trend = followed(state)
    if trend is None:
        return None
    title = f"{tr('SIZE OVER TIME')}  {trend.fault}, {trend.quantity}"
    lines = [Line(words, level_of(trend)) for words in said(trend)]
    lines += [
        Line(f"{clock(at.at_ns)} {number(at.size, trend.unit, at.sigma)}")
        for at in trend.sizes[-MOST_SIZES:]
    ]
    return Panel("growth", title, tuple(lines))


def level_of(trend: SizeTrend) -> Level:
    """An error once the limit is more likely crossed than not, a warning while that is ahead."""
    if trend.crossed > MORE_LIKELY:
        return Level.ERROR
    return Level.OK if trend.median_ns == NEVER_NS else Level.WARN


def said(trend: SizeTrend) -> Iterator[str]:
    """Level and growth in one line, the limit in another."""
    level = number(trend.level, trend.unit, trend.level_sigma)
    words = f"{level}, {tr(trend.direction)}"
    if not math.isnan(trend.slope_per_s):
        slope, sigma = trend.slope_per_s * MINUTE_S, trend.slope_sigma_per_s * MINUTE_S
        words += f": {tr('{slope} a minute', slope=number(slope, trend.unit, sigma))}"
    yield words
    if math.isnan(trend.limit):
        yield tr("no limit is stated in the fault catalogue: no end is foretold")
        return
    limit = number(trend.limit, trend.unit)
    if trend.crossed > MORE_LIKELY:
        yield tr(
            "limit {limit} is crossed, with probability {share:.0%}",
            limit=limit, share=trend.crossed,
        )  # fmt: skip
    elif trend.median_ns != NEVER_NS:
        yield tr(
            "limit {limit} reached at {at} UTC, 90 %: {low} to {high}",
            limit=limit, at=clock(trend.median_ns), low=clock(trend.low_ns), high=_end(trend),
        )  # fmt: skip
    else:
        yield tr("limit {limit}: no end is foretold", limit=limit)


def _end(trend: SizeTrend) -> str:
    return tr("never") if trend.high_ns == NEVER_NS else clock(trend.high_ns)
