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

"""A diagnosis as a picture: residuals with limits over time, and the group."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from flea_diag.api.table import Table
from flea_diag.errors import ConfigurationError, shown
from flea_diag.tools.extra import require

MOST_PANELS = 4
MOST_BARS = 8
MOST_POINTS = 4000
"""Of a line: beyond, the picture shows no more and takes megabytes."""
WIDTH_IN, PANEL_IN, BAR_IN = 9.0, 1.5, 0.28
RESIDUAL, LIMIT, EPISODE = "#0072b2", "#d55e00", "#e69f00"
"""Blue, vermilion and orange: distinguishable with colour vision deficiency."""


def picture(
    title: str,
    residuals: Table,
    chosen: tuple[str, ...],
    detected_s: Sequence[float],
    bars: Sequence[tuple[str, float]],
) -> Any:
    """Figure of a diagnosis; see ``Diagnosis.plot``."""
    require("plot", "a plot")
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    names = chosen or furthest(residuals)
    unknown = next((name for name in names if f"{name}/z" not in residuals), None)
    if unknown is not None:
        known = [name.removesuffix("/z") for name in residuals if name.endswith("/z")]
        raise ConfigurationError(
            f"residual {shown(unknown)} is unknown, choose among {', '.join(known)}"
        )
    group = bars[:MOST_BARS]
    heights = [PANEL_IN] * len(names) + [max(len(group), 1) * BAR_IN + 0.5] * bool(group)
    figure = Figure(figsize=(WIDTH_IN, sum(heights) + 0.8), layout="constrained")
    FigureCanvasAgg(figure)
    figure.suptitle(title)
    grid = figure.add_gridspec(len(heights), height_ratios=heights)
    first = None
    for place, name in enumerate(names):
        panel = figure.add_subplot(grid[place], sharex=first)
        first = first or panel
        _residual(panel, name, residuals, detected_s)
    if first is not None:
        panel.set_xlabel("time [s]")
    if group:
        _bars(figure.add_subplot(grid[-1]), group)
    return figure


def furthest(residuals: Table) -> tuple[str, ...]:
    """Names of the residuals that went furthest beyond their limits, the first ones first."""
    reach = {}
    for name in residuals:
        if name.endswith("/z"):
            plain = name.removesuffix("/z")
            ratio = np.abs(residuals[name]) / residuals[f"{plain}/limit"]
            known = ratio[np.isfinite(ratio)]
            reach[plain] = float(known.max()) if len(known) else -math.inf
    ranked = sorted(reach, key=lambda name: -reach[name])
    return tuple(name for name in ranked[:MOST_PANELS] if reach[name] > -math.inf)


def _residual(panel: Any, name: str, table: Table, detected_s: Sequence[float]) -> None:
    step = max(table.rows // MOST_POINTS, 1)
    time_s, limit = table["time_s"][::step], table[f"{name}/limit"][::step]
    panel.plot(time_s, table[f"{name}/z"][::step], color=RESIDUAL, linewidth=0.9)
    for bound in (limit, -limit):
        panel.plot(time_s, bound, color=LIMIT, linewidth=0.9, linestyle="--")
    for at_s in detected_s:
        panel.axvline(at_s, color=EPISODE, linewidth=1.2)
    panel.set_title(f"{name} [standard deviations]", fontsize=8, loc="left")
    panel.tick_params(labelsize=8)


def _bars(panel: Any, group: Sequence[tuple[str, float]]) -> None:
    chances = [chance if math.isfinite(chance) else 0.0 for _, chance in group]
    names = [fault for fault, _ in group]
    panel.barh(names[::-1], chances[::-1], color=RESIDUAL, height=0.6)
    panel.set_xlim(0.0, 1.0)
    panel.margins(y=0.3)
    panel.set_xlabel("probability")
    panel.tick_params(labelsize=8)
