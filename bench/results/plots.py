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

"""Pictures of kept results, as SVG text.

Shares with their intervals, detection over the size of a fault, how often the group held the
fault against the coverage that was stated, and what grows or shrinks with the number of
recordings of a calibration.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from html import escape
from typing import NamedTuple

from kept import KeptResult, KeptRow

from flea_diag.tools.interval import wilson

FEWEST, MOST = 4, 30
"""Rows of a picture of shares."""
WIDTH = 480
LABEL, LINE, MARGIN = 200, 18, 14
PANEL_WIDTH, PANEL_HEIGHT, PANEL_COLUMNS = 236, 130, 2
BLUE, ORANGE, GREY = "#0072b2", "#d55e00", "#999999"
"""Distinguishable with colour vision deficiency."""
_RUNG = re.compile(r"(?P<size>[^:]+): (?P<seen>\d+)(?: of (?P<of>\d+))?(?: \((?P<right>\d+)\))?")
_EACH = re.compile(r"of (\d+) (?:cases |runs )?at each size")


_GROWN = re.compile(r"(?:(?P<what>.+), )?(?P<count>\d+) recordings(?:: (?P<more>.+))?")
_STATED = re.compile(r"stated (\d+(?:\.\d+)?) %")
SIDE, SHOWN_FROM = 260, 40.0
"""Length of an axis of stated and measured coverage, and where it begins, per cent."""
FEWEST_STEPS = 3


class Grown(NamedTuple):
    """A value at so many recordings, with its range."""

    count: int
    value: float
    low: float
    high: float


class Rung(NamedTuple):
    """Shares at one size of a fault."""

    size: str
    seen: float
    right: float


def plots(kept: KeptResult) -> dict[str, str]:
    """End of a file's name -> its picture; nothing where a table says it all."""
    found = {}
    shares = [row for row in kept.rows if row.right is not None and row.count]
    if FEWEST <= len(shares) <= MOST:
        found["shares"] = share_plot(kept.title, shares)
    if stated := coverage(kept):
        found["coverage"] = coverage_plot(kept.title, stated)
    if grown := growth(kept):
        found["growth"] = growth_plot(kept.title, grown)
    ladders = {row.name: rungs for row in kept.rows if len(rungs := ladder(row, kept)) > 1}
    if ladders:
        found["sizes"] = ladder_plot(kept.title, ladders)
    return found


def growth(kept: KeptResult) -> dict[str, tuple[Grown, ...]]:
    """Name with its unit -> values over the number of recordings, where there are three or more."""
    found: dict[str, list[Grown]] = {}
    for row in kept.rows:
        name = _GROWN.fullmatch(row.name)
        if name and row.value is not None:
            what = ", ".join(filter(None, (name["what"], name["more"])))
            low, high = (row.value if end is None else end for end in (row.low, row.high))
            step = Grown(int(name["count"]), row.value, low, high)
            found.setdefault(f"{what} [{row.unit}]", []).append(step)
    return {what: tuple(rows) for what, rows in found.items() if len(rows) >= FEWEST_STEPS}


def coverage(kept: KeptResult) -> list[tuple[float, KeptRow]]:
    """Stated coverage in per cent, and the row of how often the group held the fault."""
    rows = ((_STATED.match(row.name), row) for row in kept.rows)
    return [(float(said[1]), row) for said, row in rows if said and row.value is not None]


def ladder(row: KeptRow, kept: KeptResult) -> tuple[Rung, ...]:
    """The rungs that a cell states, such as ``0.1: 7 (1); 0.2 and 0.3: 20 (15)``."""
    for name, text in row.cells.items():
        every = _EACH.search(" ".join((name, *kept.notes)))
        parts = [_RUNG.fullmatch(part.strip()) for part in text.split(";")]
        if "size" in name and every and all(parts):
            return tuple(_rung(part, int(every[1])) for part in parts if part)
    return ()


def _rung(part: re.Match[str], every: int) -> Rung:
    of = int(part["of"] or every)
    return Rung(part["size"], int(part["seen"]) / of, int(part["right"] or part["seen"]) / of)


def share_plot(title: str, rows: list[KeptRow]) -> str:
    """A point for the share of each row, and a line for its interval."""
    height = LINE * len(rows) + 2 * MARGIN + LINE
    parts = [_line(_x(share), MARGIN, _x(share), height - LINE - MARGIN + 4, GREY, 0.5)
             for share in (0.0, 0.25, 0.5, 0.75, 1.0)]  # fmt: skip
    for number, row in enumerate(rows):
        assert row.right is not None
        assert row.count is not None
        y = MARGIN + LINE * (number + 0.5)
        low, high = wilson(row.right, row.count)
        parts.append(_text(LABEL - 8, y + 4, _short(row.name, 32), "end"))
        parts.append(_line(_x(low), y, _x(high), y, BLUE, 2.0))
        parts.append(f'<circle cx="{_x(row.right / row.count):.1f}" cy="{y:.1f}" r="4"/>')
    for share in (0.0, 0.5, 1.0):
        parts.append(_text(_x(share), height - 8, f"{100 * share:g} %", "middle"))
    return _svg(f"{title}: shares with 95 % intervals", WIDTH, height, parts)


def ladder_plot(title: str, ladders: dict[str, tuple[Rung, ...]]) -> str:
    """For each fault a panel: share detected and share right over the sizes, in their order."""
    count = -(-len(ladders) // PANEL_COLUMNS)
    parts: list[str] = []
    for number, (name, rungs) in enumerate(ladders.items()):
        left = 4 + PANEL_WIDTH * (number % PANEL_COLUMNS)
        parts += _panel(name, rungs, left, PANEL_HEIGHT * (number // PANEL_COLUMNS))
    y = PANEL_HEIGHT * count + 14
    for x, colour, words in ((20, BLUE, "detected"), (160, ORANGE, "right")):
        parts += [_line(x, y - 4, x + 24, y - 4, colour, 2.0), _text(x + 30, y, words)]
    return _svg(f"{title}: shares over the size of the fault", WIDTH, y + 10, parts)


def coverage_plot(title: str, stated: list[tuple[float, KeptRow]]) -> str:
    """Measured over stated coverage with intervals; on the line both are the same."""
    left, low = 60.0, MARGIN + SIDE

    def place(share: float) -> float:
        return SIDE * (share - SHOWN_FROM) / (100.0 - SHOWN_FROM)

    parts = [_line(left, low, left + SIDE, low - SIDE, GREY, 1.0)]
    parts.append(f'<path d="M{left} {MARGIN}V{low}H{left + SIDE}" {_stroke(GREY, 1.0)}/>')
    for share in (40, 60, 80, 100):
        parts.append(_text(left + place(share), low + 16, f"{share} %", "middle"))
        parts.append(_text(left - 6, low - place(share) + 4, f"{share} %", "end"))
    for said, row in stated:
        assert row.value is not None
        x, ends = left + place(said), (row.low, row.high)
        high_low = [low - place(row.value if end is None else end) for end in ends]
        parts.append(_line(x, high_low[0], x, high_low[1], BLUE, 2.0))
        parts.append(f'<circle cx="{x:.1f}" cy="{low - place(row.value):.1f}" r="4"/>')
    parts.append(_text(left + SIDE / 2, low + 34, "stated coverage", "middle"))
    # Beside the square: a coverage of all would lie below it.
    parts.append(_text(left + SIDE + 12, MARGIN + 4, "measured: fault"))
    parts.append(_text(left + SIDE + 12, MARGIN + 20, "in the group"))
    return _svg(f"{title}: measured over stated", WIDTH, low + 46, parts)


def growth_plot(title: str, grown: dict[str, tuple[Grown, ...]]) -> str:
    """For each quantity a panel: its value and range over the number of recordings."""
    count = -(-len(grown) // PANEL_COLUMNS)
    parts: list[str] = []
    for number, (name, steps) in enumerate(grown.items()):
        left = 4 + PANEL_WIDTH * (number % PANEL_COLUMNS)
        parts += _grown_panel(name, steps, left, PANEL_HEIGHT * (number // PANEL_COLUMNS))
    y = PANEL_HEIGHT * count + 8
    parts.append(_text(20, y, "over the number of recordings; lines: the range where one is kept"))
    return _svg(f"{title}: over the number of recordings", WIDTH, y + 10, parts)


def _grown_panel(name: str, steps: tuple[Grown, ...], left: float, top: float) -> Iterator[str]:
    low, high, right = top + PANEL_HEIGHT - 30, top + 26, left + PANEL_WIDTH - 20
    step = (right - left - 36) / max(len(steps) - 1, 1)
    most = max(each.high for each in steps) or 1.0
    places = [(left + 30 + k * step, each) for k, each in enumerate(steps)]

    def y(value: float) -> float:
        return low - max(value, 0.0) / most * (low - high)

    yield _text(left + 10, top + 14, _short(name, 36))
    yield f'<path d="M{left + 10:.1f} {high:.1f}V{low:.1f}H{right + 6:.1f}" {_stroke(GREY, 1.0)}/>'
    yield _text(left + 14, high + 4, f"{most:.3g}")
    points = " ".join(f"{x:.1f},{y(each.value):.1f}" for x, each in places)
    yield f'<polyline points="{points}" {_stroke(BLUE, 2.0)}/>'
    for x, each in places:
        yield _line(x, y(each.low), x, y(each.high), ORANGE, 1.5)
        yield f'<circle cx="{x:.1f}" cy="{y(each.value):.1f}" r="3"/>'
        yield _text(x, low + 16, str(each.count), "middle")


def _panel(name: str, rungs: tuple[Rung, ...], left: float, top: float) -> Iterator[str]:
    low, high, right = top + PANEL_HEIGHT - 30, top + 20, left + PANEL_WIDTH - 20
    step = (right - left - 20) / max(len(rungs) - 1, 1)
    yield _text(left + 10, top + 14, _short(name, 34))
    yield f'<path d="M{left + 10:.1f} {high:.1f}V{low:.1f}H{right + 6:.1f}" {_stroke(GREY, 1.0)}/>'
    for colour, values in ((BLUE, [r.seen for r in rungs]), (ORANGE, [r.right for r in rungs])):
        points = " ".join(
            f"{left + 16 + k * step:.1f},{low - v * (low - high):.1f}" for k, v in enumerate(values)
        )
        yield f'<polyline points="{points}" {_stroke(colour, 2.0)}/>'
    for k in sorted({0, len(rungs) - 1}):
        end = "start" if k == 0 else "end"
        yield _text(left + (10 if k == 0 else 22 + k * step), low + 16, rungs[k].size, end)


def _x(share: float) -> float:
    return LABEL + share * (WIDTH - LABEL - 24)


def _short(words: str, most: int) -> str:
    return words if len(words) <= most else words[: most - 1] + "…"


def _stroke(colour: str, width: float) -> str:
    return f'fill="none" stroke="{colour}" stroke-width="{width}"'


def _line(x: float, y: float, to_x: float, to_y: float, colour: str, width: float) -> str:
    return f'<path d="M{x:.1f} {y:.1f}L{to_x:.1f} {to_y:.1f}" {_stroke(colour, width)}/>'


def _text(x: float, y: float, words: str, anchor: str = "start") -> str:
    return f'<text x="{x:.1f}" y="{y:.1f}" text-anchor="{anchor}">{escape(words)}</text>'


def _svg(title: str, width: float, height: float, parts: list[str]) -> str:
    head = (
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width:g} {height:g}" role="img" '
        f'font-family="sans-serif" font-size="12" width="{width:g}">'
    )
    style = f"<title>{escape(title)}</title><style>circle{{fill:{BLUE}}}text{{fill:#222}}</style>"
    return "\n".join([head, style, '<rect width="100%" height="100%" fill="#fff"/>', *parts,
                      "</svg>", ""])  # fmt: skip
