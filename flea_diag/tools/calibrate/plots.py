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

"""Plots of a calibration: residuals of each nominal recording with their limits."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from flea_diag.core.running_mean import rolling_means
from flea_diag.tools.terminal import make_folder, writing

if TYPE_CHECKING:
    from flea_diag.core.calibration.calibration import Calibration
    from flea_diag.core.calibration.nominal_trace import Trace
    from flea_diag.core.detection.window_limit import ResidualLimit, WindowLimit

Array = npt.NDArray[np.float64]

COLUMNS = 3
PANEL_IN = (5.2, 1.7)
RESIDUAL, LIMIT, OUTSIDE = "#0072b2", "#d55e00", "#999999"
"""Blue, vermilion and grey: distinguishable with colour vision deficiency."""


def draw(calibration: Calibration, traces: Sequence[Trace], folder: Path, kind: str) -> list[Path]:
    """Draw one plot per recording, ``<recording>.<kind>`` in the folder; return their paths."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    make_folder(folder)
    limits = [limit for limit in calibration.limits if limit.windows[0].window > 1]
    rows = math.ceil(len(limits) / COLUMNS)
    made = []
    for trace in traces:
        figure = Figure(figsize=(PANEL_IN[0] * COLUMNS, PANEL_IN[1] * rows), layout="constrained")
        FigureCanvasAgg(figure)
        figure.suptitle(
            f"{trace.name}: residuals and limits at {calibration.false_alarms_per_hour:g} false "
            "alarms per hour (grey: not tested)"
        )
        panels = figure.subplots(rows, COLUMNS, sharex=True, squeeze=False).ravel()
        for panel, limit in zip(panels, limits, strict=False):
            _panel(panel, limit, trace, calibration.period_s)
        for panel in panels[len(limits) :]:
            panel.set_visible(False)
        for panel in panels[max(len(limits) - COLUMNS, 0) : len(limits)]:
            panel.tick_params(labelbottom=True)
            panel.set_xlabel("time [s]", fontsize=7, labelpad=0)
        target = folder / f"{trace.name}.{kind}"
        with writing(target):
            figure.savefig(target, dpi=80)
        made.append(target)
    return made


def _panel(panel: Any, limit: ResidualLimit, trace: Trace, period_s: float) -> None:
    row = trace.rows.named[limit.name]
    window = limit.windows[len(limit.windows) // 2]
    time_s = np.arange(len(trace.values)) * period_s
    mean, low, high = windowed(limit, window, trace)
    panel.fill_between(time_s, 0, 1, where=np.isnan(mean), transform=panel.get_xaxis_transform(),
                       color=OUTSIDE, alpha=0.25, linewidth=0)  # fmt: skip
    panel.plot(time_s, mean, color=RESIDUAL, linewidth=1.0)
    for bound in (low, high):
        panel.plot(time_s, bound, color=LIMIT, linewidth=1.0, linestyle="--")
    panel.set_title(f"{limit.name} [{row.unit}], mean of {window.window}", fontsize=8, loc="left")
    panel.tick_params(labelsize=7)
    panel.set_xlim(0.0, float(time_s[-1]))


def windowed(limit: ResidualLimit, window: WindowLimit, trace: Trace) -> tuple[Array, Array, Array]:
    """Statistic of one test over a recording with its lower and upper limit, (scans,) each.

    NaN where not tested. The limits cover nominal scatter only; in a diagnosis the variability
    of healthy units is added.
    """
    from flea_diag.core.detection.window_limit import SPEED_REGIONS_M_S

    values = trace.values[:, trace.rows.place[limit.name]]
    tested = np.isfinite(values)
    if trace.rows.named[limit.name].gate == "moving":
        tested &= trace.moving
    mean, low, high = (np.full(len(values), np.nan) for _ in range(3))
    count = window.window
    at = np.flatnonzero(tested)[count - 1 :]
    if not len(at):
        return mean, low, high
    statistic = rolling_means(values[tested], count)
    speed = rolling_means(np.nan_to_num(trace.speed_m_s[tested]), count)
    region = np.searchsorted(SPEED_REGIONS_M_S, speed)
    centre, reach = np.take(window.centre, region), window.k * np.take(window.sigma, region)
    mean[at], low[at], high[at] = statistic, centre - reach, centre + reach
    return mean, low, high
