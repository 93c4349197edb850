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

"""Picture of a size over time: estimates with their errors, the limit, and when it is reached."""

from __future__ import annotations

import math
from collections.abc import Callable

from flea_diag.operator.evidence_view import level_of, said
from flea_diag.operator.panel import clock
from flea_diag.operator.quantity import number
from flea_diag.operator.words import tr
from flea_diag.web.markup import Markup, joined, path, tag, text
from flea_diag.web.panels import CLASS
from flea_diag.wire.records import NEVER_NS, SizeTrend

WIDTH, HEIGHT, LEFT, BELOW, ABOVE = 640.0, 200.0, 70.0, 22.0, 12.0
FURTHEST = 3.0
"""An end further off than so many times the time so far is not drawn."""
BAND_SIGMAS = 1.645
"""Half the width of a band of 90 %."""

Place = Callable[[float], float]


def size_chart(trend: SizeTrend) -> Markup:
    """The words of the trend and its picture."""
    words = (tag("p", each, class_=f"state {CLASS[level_of(trend)]}") for each in said(trend))
    return joined(tag("p", f"{trend.fault}, {trend.quantity}"), *words, _picture(trend))


def _picture(trend: SizeTrend) -> Markup:
    first_ns, last_ns = trend.sizes[0].at_ns, trend.stamp_ns
    end_ns = last_ns
    if trend.median_ns != NEVER_NS:
        most_ns = last_ns + FURTHEST * (last_ns - first_ns)
        far_ns = trend.median_ns if trend.high_ns == NEVER_NS else trend.high_ns
        end_ns = round(min(max(far_ns, last_ns), most_ns))
    lows, highs = zip(*((at.size - _half(at.sigma), at.size + _half(at.sigma))
                        for at in trend.sizes), strict=True)  # fmt: skip
    has_limit = not math.isnan(trend.limit)
    ends = (0.0, *lows, *highs, *((trend.limit,) if has_limit else ()))
    x = _placed(first_ns, end_ns, LEFT, WIDTH - 10.0)
    y = _placed(min(ends), max(ends), HEIGHT - BELOW, ABOVE)
    drawn = [_axes(trend, x, y, end_ns), _sizes(trend, x, y)]
    if has_limit:
        drawn.append(_limit(trend, x, y, end_ns))
    described = tr("size over time of {fault}", fault=trend.fault)
    return tag(
        "svg", *drawn, viewBox=f"0 0 {WIDTH:g} {HEIGHT:g}", role="img", aria_label=described,
        class_="size-chart",
    )  # fmt: skip


def _half(sigma: float) -> float:
    return BAND_SIGMAS * sigma


def _placed(low: float, high: float, at_low: float, at_high: float) -> Place:
    span = (high - low) or 1.0
    return lambda value: at_low + (value - low) / span * (at_high - at_low)


def _axes(trend: SizeTrend, x: Place, y: Place, end_ns: int) -> Markup:
    zero, first_ns = y(0.0), trend.sizes[0].at_ns
    top = trend.limit if not math.isnan(trend.limit) else max(at.size for at in trend.sizes)
    return joined(
        path(f"M{LEFT:.1f} {zero:.1f}H{WIDTH - 10.0:.1f}", "axis"),
        text(LEFT - 6.0, zero + 4.0, "0", "note", "end"),
        text(LEFT - 6.0, y(top) + 4.0, number(top, trend.unit), "note", "end"),
        text(x(first_ns), HEIGHT - 6.0, clock(first_ns)[:8], "note"),
        text(x(end_ns), HEIGHT - 6.0, clock(end_ns)[:8], "note", "end"),
    )


def _sizes(trend: SizeTrend, x: Place, y: Place) -> Markup:
    """A bar of 90 % for each size by its own error, and a line through the sizes."""
    bars = "".join(
        f"M{x(at.at_ns):.1f} {y(at.size - _half(at.sigma)):.1f}V{y(at.size + _half(at.sigma)):.1f}"
        for at in trend.sizes
    )
    line = "L".join(f"{x(at.at_ns):.1f} {y(at.size):.1f}" for at in trend.sizes)
    return joined(path(bars, "band"), path(f"M{line}", "course"))


def _limit(trend: SizeTrend, x: Place, y: Place, end_ns: int) -> Markup:
    """The limit, and along it the interval and the median of the time at which it is reached."""
    height = y(trend.limit)
    drawn = [path(f"M{LEFT:.1f} {height:.1f}H{WIDTH - 10.0:.1f}", "limit")]
    if trend.median_ns != NEVER_NS:
        high_ns = end_ns if trend.high_ns == NEVER_NS else min(trend.high_ns, end_ns)
        low, high = x(min(trend.low_ns, end_ns)), x(high_ns)
        drawn.append(path(f"M{low:.1f} {height:.1f}H{high:.1f}", "foretold"))
        if trend.median_ns <= end_ns:
            at, last = x(trend.median_ns), trend.sizes[-1]
            ahead = f"M{x(last.at_ns):.1f} {y(last.size):.1f}L{at:.1f} {height:.1f}"
            drawn += [
                path(ahead, "ahead"),
                tag("circle", cx=f"{at:.1f}", cy=f"{height:.1f}", r="4", class_="end"),
            ]
    return joined(*drawn)
