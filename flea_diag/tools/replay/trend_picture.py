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

"""Picture of trends: sizes with their errors, the forecast, the limit and when it is reached."""

from __future__ import annotations

import math
from collections.abc import Sequence
from datetime import datetime, timedelta, timezone
from pathlib import Path
from typing import Any

import numpy as np

from flea_diag.core.prognosis.forecast import SHARES
from flea_diag.tools.replay.unit_trend import UnitTrend
from flea_diag.tools.terminal import writing

PANEL_IN = (8.0, 3.6)
COURSE, LIMIT = "#0072b2", "#d55e00"
"""Blue and vermilion: distinguishable with colour vision deficiency."""
BAND_SIGMAS = 1.645
STEPS = 120
FURTHEST = 2.0
"""The forecast is drawn for so many times the time so far at most."""


def draw_trends(trends: Sequence[UnitTrend], target: Path) -> None:
    """Draw a panel for each trend, into a file of the kind that its ending says."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.dates import AutoDateLocator, ConciseDateFormatter
    from matplotlib.figure import Figure

    size = PANEL_IN[0], PANEL_IN[1] * len(trends)
    figure = Figure(figsize=size, layout="constrained")
    FigureCanvasAgg(figure)
    panels = figure.subplots(len(trends), 1, squeeze=False)[:, 0]
    for panel, trend in zip(panels, trends, strict=True):
        _panel(panel, trend)
        locator = AutoDateLocator()
        panel.xaxis.set_major_locator(locator)
        panel.xaxis.set_major_formatter(ConciseDateFormatter(locator))
    with writing(target):
        figure.savefig(target, dpi=100)


def _panel(panel: Any, trend: UnitTrend) -> None:
    first, series = trend.all[0], trend.series
    start = datetime.fromtimestamp(first.stamp_ns / 1e9, tz=timezone.utc)

    def at(times_s: Sequence[float]) -> list[datetime]:
        return [start + timedelta(seconds=time_s) for time_s in times_s]

    errors = BAND_SIGMAS * series.own
    label = "sizes, 90 % by their own errors"
    panel.errorbar(at(series.times.tolist()), series.sizes, errors, fmt="o", color=COURSE,
                   markersize=4, capsize=3, label=label)  # fmt: skip
    top = 1.25 * max(float((series.sizes + errors).max()), _limit(trend))
    panel.set_ylim(min(0.0, 1.05 * float((series.sizes - errors).min())), top)
    end_s = _forecast(panel, trend, at, top)
    if _limit(trend):
        panel.axhline(trend.limit, color=LIMIT, linestyle="--", label="limit")
    panel.set_xlim(*at([_before(series.times[0], end_s), _before(end_s, series.times[0])]))
    unit = "" if first.unit == "1" else f", {first.unit}"
    panel.set_ylabel(f"{first.quantity or 'size'}{unit}")
    panel.set_title(f"{first.serial}: {first.fault}", loc="left", fontsize=10)
    panel.legend(loc="lower right", fontsize=8)
    panel.tick_params(labelsize=8)


def _limit(trend: UnitTrend) -> float:
    """The limit; 0: there is none."""
    return trend.limit if math.isfinite(trend.limit) else 0.0


def _before(time_s: float, other_s: float) -> float:
    """A little further from the other end."""
    return float(time_s + 0.03 * (time_s - other_s))


def _forecast(panel: Any, trend: UnitTrend, at: Any, top: float) -> float:
    """The course with its band, and when the limit is reached; until when it is drawn, s."""
    found, crossing, times = trend.forecast, trend.crossing, trend.series.times
    last_s, span_s = float(times[-1]), float(times[-1] - times[0])
    if found is None:
        return last_s or 1.0
    most_s = last_s + FURTHEST * span_s
    end_s = last_s + 0.5 * span_s
    if crossing is not None:
        high_s = crossing["high_s"]
        end_s = most_s if high_s is None else min(max(high_s, last_s), most_s)
    grid = np.linspace(float(times[0]), end_s, STEPS)
    low, median, high = np.transpose([found.quantiles(found.sizes_at(t), SHARES) for t in grid])
    low, high = np.minimum(low, top), np.minimum(high, top)
    panel.fill_between(at(grid.tolist()), low, high, color=COURSE, alpha=0.2, linewidth=0)
    panel.plot(at(grid.tolist()), np.minimum(median, top), color=COURSE, label="forecast, 90 %")
    if crossing is not None and crossing["median_s"] is not None:
        low_s, median_s = crossing["low_s"], crossing["median_s"]
        shown = [min(time_s, end_s) for time_s in (low_s, crossing["high_s"] or end_s)]
        panel.plot(at(shown), [trend.limit] * 2, color=LIMIT, linewidth=5, alpha=0.5)
        if median_s <= end_s:
            told = f"reached {at([median_s])[0]:%Y-%m-%d %H:%M}"
            panel.plot(at([median_s]), [trend.limit], "o", color=LIMIT, label=told)
    return float(end_s)
