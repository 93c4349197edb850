"""Pictures of kept results, as SVG text: shares with their intervals, and ladders of sizes."""

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
    ladders = {row.name: rungs for row in kept.rows if len(rungs := ladder(row, kept)) > 1}
    if ladders:
        found["sizes"] = ladder_plot(kept.title, ladders)
    return found


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
