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

"""Small charts as SVG text for screen, phone and paper; no script, no font.

Each takes what ``run_trace`` kept. Colours come from the page's style sheet by class, and every
meaning has a shape or a word besides its colour.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from html import escape
from typing import Any

from flea_diag.errors import visible

WIDTH = 720.0
LEFT, RIGHT = 8.0, 8.0
POINTS = 180
"""Most stretches of a drawn trace; neighbours are joined."""
STRIP_HEIGHT = 64.0
ROW_HEIGHT = 16.0
NAMES = 190.0
LIMIT_SHOWN = 3.0
"""Residuals are clipped at this multiple of their limit."""
ESTIMATE_ROOM = 0.3
"""An estimate may widen a chart by this share of the signal's range; beyond, it is clipped."""
MOST_TICKS = 8

Trace = Mapping[str, Any]
Mark = tuple[float, str, str]
"""Time (s), words, style class."""


def strip(
    trace: Trace,
    duration_s: float,
    marks: Iterable[Mark] = (),
    limit: bool = False,
    estimate: Trace | None = None,
) -> str:
    """Extremes of one trace over time as a band.

    Parameters
    ----------
    limit
        The trace is a share of its limit: lines at 1 and -1, clipped at ``LIMIT_SHOWN``.
    estimate
        Band of the estimate, drawn over the trace with a line through its middle.
    """
    bottom, top = _range(trace, limit)
    if estimate is not None:
        room = ESTIMATE_ROOM * (top - bottom)
        low, high = _range(estimate, False)
        bottom, top = max(min(bottom, low), bottom - room), min(max(top, high), top + room)

    def x(time_s: float) -> float:
        return _across(time_s, duration_s, LEFT)

    def y(value: float) -> float:
        inside = min(max(value, bottom), top)
        return 4.0 + (STRIP_HEIGHT - 8.0) * (top - inside) / (top - bottom)

    lines = "".join(
        f'<line class="limit" x1="{LEFT}" x2="{WIDTH - RIGHT}" y1="{y(at):.1f}" y2="{y(at):.1f}"/>'
        for at in ((1.0, -1.0) if limit else ())
    )
    drawn = _bands(trace, "band", x, y)
    if estimate is not None:
        drawn += _bands(estimate, "estimate", x, y)
    marked = _marks(marks, duration_s, LEFT, STRIP_HEIGHT)
    return _svg(STRIP_HEIGHT, lines + drawn + marked, 'class="strip" preserveAspectRatio="none"')


def time_axis(duration_s: float, left: float = LEFT) -> str:
    """Time axis below charts that begin at ``left``; text, since charts are stretched."""
    raw = max(duration_s, 1e-9) / MOST_TICKS
    size = 10.0 ** math.floor(math.log10(raw))
    step = next(size * k for k in (1, 2, 5, 10) if size * k >= raw * (1.0 - 1e-9))
    ticks = (k * step for k in range(int(duration_s / step + 1e-9) + 1))
    drawn = "".join(
        f'<span style="left:{100.0 * x / WIDTH:.2f}%">{at_s:g} s</span>'
        for at_s in ticks
        for x in (_across(at_s, duration_s, left),)
    )
    return f'<div class="axis">{drawn}</div>'


def _range(trace: Trace, limit: bool) -> tuple[float, float]:
    """Smallest and largest value of a chart of this trace."""
    known = [v for key in ("low", "high") for v in trace[key] if v is not None]
    bottom, top = (min(known), max(known)) if known else (0.0, 1.0)
    if limit:
        top = min(max(top, 1.2), LIMIT_SHOWN)
        bottom = max(min(bottom, -1.2), -LIMIT_SHOWN)
    return (bottom, top) if top - bottom >= 1e-12 else (bottom - 0.5, top + 0.5)


def _bands(trace: Trace, kind: str, x: Any, y: Any) -> str:
    """Each stretch without a gap as an area; an estimate with its centre line."""
    low, high = _joined(trace["low"], min), _joined(trace["high"], max)
    stretch_s = trace["stretch_s"] * len(trace["low"]) / max(len(low), 1)
    drawn = []
    for run in _runs(low, high):
        drawn.append(f'<path class="{kind}" d="{_band(run, stretch_s, x, y)}"/>')
        if kind == "estimate":
            line = (f"{x((k + 0.5) * stretch_s):.0f},{y((a + b) / 2):.1f}" for k, a, b in run)
            drawn.append(f'<path class="middle" d="M{"L".join(line)}"/>')
    return "".join(drawn)


def range_words(trace: Trace) -> str:
    """Smallest and largest value of a trace, with its unit."""
    known = [v for key in ("low", "high") for v in trace[key] if v is not None]
    if not known:
        return "no value"
    return f"{min(known):.4g} to {max(known):.4g} {trace['unit']}".strip()


def symbol_matrix(
    symbols: Sequence[Sequence[Any]], duration_s: float, marks: Iterable[Mark] = ()
) -> str:
    """Symbols of each residual over time: rows in the order of their first deviation."""
    names = list(dict.fromkeys(row[0] for _, rows in symbols for row in rows))
    if not names:
        return ""
    ends = [at_s for at_s, _ in symbols[1:]] + [duration_s]
    cells = []
    for (at_s, rows), end_s in zip(symbols, ends, strict=True):
        for name, magnitude, slope in rows:
            x0, x1 = (_across(t, duration_s, NAMES) for t in (at_s, end_s))
            top = names.index(name) * ROW_HEIGHT
            kind = {"+": "plus", "-": "minus"}.get(magnitude, "zero")
            cells.append(
                f'<rect class="{kind}" x="{x0:.1f}" y="{top + 1:.1f}" '
                f'width="{max(x1 - x0, 0.5):.1f}" height="{ROW_HEIGHT - 2:.1f}"/>'
            )
            if x1 - x0 > 18.0:
                cells.append(_text(x0 + 3.0, top + 12.0, magnitude + slope, "symbol"))
    height = len(names) * ROW_HEIGHT
    labels = (_text(4.0, k * ROW_HEIGHT + 12.0, name, "name") for k, name in enumerate(names))
    return _svg(height, "".join([*cells, *labels]) + _marks(marks, duration_s, NAMES, height))


def group_steps(
    groups: Sequence[Mapping[str, Any]], duration_s: float, marks: Iterable[Mark] = ()
) -> str:
    """The ambiguity group over time: one line per fault while it is in the group."""
    spans = _memberships(groups, duration_s)
    if not spans:
        return ""
    height = len(spans) * ROW_HEIGHT
    drawn = []
    for k, (fault, (start_s, end_s, stays)) in enumerate(spans.items()):
        y = (k + 0.5) * ROW_HEIGHT
        x0, x1 = (_across(t, duration_s, NAMES) for t in (start_s, end_s))
        kind = "member" if stays else "dropped"
        drawn.append(_text(4.0, y + 4.0, fault, f"name {kind}"))
        drawn.append(
            f'<line class="{kind}" x1="{x0:.1f}" x2="{x1:.1f}" y1="{y:.1f}" y2="{y:.1f}"/>'
        )
        if not stays:
            drawn.append(_text(x1 + 2.0, y + 4.0, "×", "name dropped"))
    return _svg(height, "".join(drawn) + _marks(marks, duration_s, NAMES, height))


def _memberships(
    groups: Sequence[Mapping[str, Any]], duration_s: float
) -> dict[str, tuple[float, float, bool]]:
    """Fault -> start, end and whether it remained, in the last episode; last dropped first."""
    last = max((group["episode"] for group in groups), default=0)
    part = [group for group in groups if last and group["episode"] == last]
    ends = [group["at_s"] for group in part[1:]] + [duration_s] * bool(part)
    spans: dict[str, tuple[float, float, bool]] = {}
    for group, end_s in zip(part, ends, strict=True):
        for fault, _ in group["members"]:
            start_s = spans[fault][0] if fault in spans else group["at_s"]
            spans[fault] = start_s, end_s, group is part[-1]
    return dict(sorted(spans.items(), key=lambda item: (-item[1][1], item[0])))


def _joined(values: Sequence[float | None], pick: Any) -> list[float | None]:
    """At most ``POINTS`` values, the extremes of neighbours."""
    step = -(-len(values) // POINTS) or 1
    parts = (values[k : k + step] for k in range(0, len(values), step))
    return [pick(known) if (known := [v for v in p if v is not None]) else None for p in parts]


def _runs(
    low: Sequence[float | None], high: Sequence[float | None]
) -> list[list[tuple[int, float, float]]]:
    """Stretches without a gap."""
    runs: list[list[tuple[int, float, float]]] = [[]]
    for k, (a, b) in enumerate(zip(low, high, strict=True)):
        if a is None or b is None:
            runs.append([])
        else:
            runs[-1].append((k, a, b))
    return [run for run in runs if run]


def _band(run: Sequence[tuple[int, float, float]], stretch_s: float, x: Any, y: Any) -> str:
    there = [f"{x((k + 0.5) * stretch_s):.0f},{y(high) - 0.6:.1f}" for k, _, high in run]
    back = [f"{x((k + 0.5) * stretch_s):.0f},{y(low) + 0.6:.1f}" for k, low, _ in reversed(run)]
    return "M" + "L".join([*there, *back]) + "Z"


def _across(time_s: float, duration_s: float, left: float) -> float:
    inside = min(max(time_s, 0.0), duration_s)
    return left + (WIDTH - RIGHT - left) * inside / max(duration_s, 1e-9)


def _marks(marks: Iterable[Mark], duration_s: float, left: float, height: float) -> str:
    drawn = []
    for at_s, words, kind in marks:
        x = _across(at_s, duration_s, left)
        line = f'<line class="{kind}" x1="{x:.1f}" x2="{x:.1f}" y1="0" y2="{height}">'
        drawn.append(f"{line}<title>{escape(visible(words))}</title></line>")
    return "".join(drawn)


def _text(x: float, y: float, words: str, kind: str) -> str:
    return f'<text class="{kind}" x="{x:.1f}" y="{y:.1f}">{escape(visible(words))}</text>'


def _svg(height: float, content: str, given: str = "") -> str:
    return f'<svg viewBox="0 0 {WIDTH:.0f} {height:.0f}" role="img" {given}>{content}</svg>'
