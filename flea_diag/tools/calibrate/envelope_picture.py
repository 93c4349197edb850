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

"""Picture of the envelope of a calibration: where recordings lie, and where limits grow."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from flea_diag.tools.calibrate.operating_points import OperatingPoints
from flea_diag.tools.terminal import writing

if TYPE_CHECKING:
    from flea_diag.core.calibration.calibration import Calibration
    from flea_diag.core.calibration.nominal_trace import Trace
    from flea_diag.core.residuals.relation_set import RelationSet

Array = npt.NDArray[np.float64]

EVERY = 5
"""One scan in this many is drawn."""
FINE = 60
"""Points of a grid along each axis."""
MARGIN = 0.6
"""Share of a range by which the picture goes beyond it on both sides."""
SCANS, GROWS, ABSTAINS = "#0072b2", "#e69f00", "#d55e00"
"""Blue, orange and vermilion: distinguishable with colour vision deficiency."""
PANEL_IN = (5.2, 4.0)


def draw_envelope(
    calibration: Calibration,
    traces: Sequence[Trace],
    relations: RelationSet,
    folder: Path,
    kind: str,
) -> Path:
    """Draw ``envelope.<kind>`` in the folder: of each relation every pair of its signals.

    Below them stands what supplied each predicted temperature, over time.
    """
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    points = OperatingPoints(calibration, relations)
    names = [row.relation for row in points.envelope.relations]
    pairs = {name: _pairs(points.axes(name)) for name in names}
    stores = [row.name for row in relations.predictions]
    heated = [name for name in stores if name in points.envelope.supplies]
    width = max(len(heated), *map(len, pairs.values()))
    rows = len(names) + bool(heated)
    size = PANEL_IN[0] * width, PANEL_IN[1] * rows
    figure = Figure(figsize=size, layout="constrained")
    FigureCanvasAgg(figure)
    figure.suptitle(
        "Scans of the recordings; limits grow outside orange, no test outside vermilion"
    )
    panels = figure.subplots(rows, width, squeeze=False)
    for panel in panels.flat:
        panel.set_visible(False)
    for row, name in zip(panels, names, strict=False):
        for panel, pair in zip(row, pairs[name], strict=False):
            _panel(panel, points, name, pair, [_columns(t, relations, pair) for t in traces])
    if heated:
        supplied = [_supplied(trace, relations, calibration) for trace in traces]
        for panel, name in zip(panels[-1], heated, strict=False):
            of_store = [each[:, stores.index(name)] for each in supplied]
            unit = relations.predictions[stores.index(name)].unit
            _heat(panel, name, unit, points.envelope.supplies[name], of_store, calibration)
    target = folder / f"envelope.{kind}"
    with writing(target):
        figure.savefig(target, dpi=80)
    return target


def _pairs(axes: Sequence[str]) -> list[tuple[str, str]]:
    return [(a, b) for k, a in enumerate(axes) for b in axes[k + 1 :]] or [(axes[0], axes[0])]


def _columns(trace: Trace, relations: RelationSet, pair: tuple[str, str]) -> Array:
    """The two signals of a recording in motion, shape (scans, 2)."""
    place = {name: k for k, name in enumerate(relations.signals)}
    columns = [
        trace.position if name == trace.position_channel else trace.signals[:, place[name]]
        for name in pair
    ]
    return np.stack(columns, axis=1)[trace.moving][::EVERY]


def _panel(
    panel: Any, points: OperatingPoints, name: str, pair: tuple[str, str], parts: list[Array]
) -> None:
    """Scans, and where the leverage reaches its two bounds with all other signals as usual."""
    from flea_diag.core.residuals.leverage import ABSTAIN, PLACE

    panel.set_visible(True)
    for part in parts:
        panel.plot(*part.T, ".", color=SCANS, markersize=1.2, alpha=0.4)
    seen = np.concatenate(parts)
    x, y = (_around(seen[:, k]) for k in (0, 1))
    grid = np.meshgrid(x, y)
    others = {n: sum(points.envelope.ranges[n]) / 2.0 for n in points.axes(name) if n not in pair}
    given = {n: np.full(grid[0].size, value) for n, value in others.items()}
    h = points.leverages(given | {n: g.ravel() for n, g in zip(pair, grid, strict=True)})[name]
    row = next(r for r in points.envelope.relations if r.relation == name)
    levels = {GROWS: row.reach} | ({} if name == PLACE else {ABSTAINS: ABSTAIN * row.most})
    for colour, level in levels.items():
        if h.min() < level < h.max():
            panel.contour(*grid, h.reshape(grid[0].shape), levels=[level], colors=colour)
    panel.set_title(name, fontsize=8, loc="left")
    panel.set_xlabel(pair[0], fontsize=8)
    panel.set_ylabel(pair[1], fontsize=8)
    panel.tick_params(labelsize=7)


def _supplied(trace: Trace, relations: RelationSet, calibration: Calibration) -> Array:
    """Mean supply of each predicted temperature in a recording, shape (scans, stores)."""
    from flea_diag.core.residuals.thermal import SupplyMean

    mean = SupplyMean(relations, calibration.parameters, calibration.counts.period_s)
    return mean.step(trace.signals)


def _heat(
    panel: Any, name: str, unit: str, most: float, supplied: list[Array], calibration: Calibration
) -> None:
    """Mean supply of a predicted temperature in every recording, and the bounds of its tests."""
    from flea_diag.core.residuals.leverage import ABSTAIN

    panel.set_visible(True)
    for each in supplied:
        time_s = np.arange(len(each)) * calibration.counts.period_s
        panel.plot(time_s, each, color=SCANS, linewidth=0.8, alpha=0.5)
    panel.axhline(most, color=GROWS)
    panel.axhline(ABSTAIN**0.5 * most, color=ABSTAINS)
    panel.set_title(name, fontsize=8, loc="left")
    panel.set_xlabel("time (s)", fontsize=8)
    panel.set_ylabel(f"mean supply ({unit}/s)", fontsize=8)
    panel.tick_params(labelsize=7)


def _around(values: Array) -> Array:
    """A line of values from below the smallest to above the largest."""
    low, high = np.nanmin(values), np.nanmax(values)
    more = MARGIN * (high - low)
    return np.linspace(low - more, high + more, FINE)
