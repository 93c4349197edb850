"""What a screen is made of: panels of lines, each line with its level; and how numbers are said.

Nothing here knows what a screen is: a terminal, a pipe or a page renders the same panels.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from flea_diag.wire.records import NEVER_NS, Level

BAR_CELLS = 14
EIGHTHS = " ▏▎▍▌▋▊▉█"
NS = 1_000_000_000


@dataclass(frozen=True, slots=True)
class Line:
    """One line of text; its level gives the colour, the words say the same without.

    A line with a ``key`` stands for something that can be chosen; lines without one that follow
    belong to it.
    """

    text: str
    level: Level | None = None
    key: str = ""


@dataclass(frozen=True, slots=True)
class Panel:
    """A titled block of lines; ``name`` is short and stays the same."""

    name: str
    title: str
    lines: tuple[Line, ...] = ()

    def text(self) -> str:
        """The panel in plain text."""
        return "\n".join([self.title, *(line.text for line in self.lines)])


def clock(stamp_ns: int) -> str:
    """Time of day in UTC to the millisecond."""
    if stamp_ns == NEVER_NS:
        return "--:--:--"
    seconds = stamp_ns // NS % 86400
    hours, minutes = seconds // 3600, seconds // 60 % 60
    return f"{hours:02d}:{minutes:02d}:{seconds % 60:02d}.{stamp_ns // 1_000_000 % 1000:03d}"


def share(probability: float) -> str:
    """A probability in percent, 5 characters; no rounding makes it certain or impossible."""
    if not 0.0 <= probability <= 1.0:
        return "    ?"
    if 0.0 < probability < 0.01:
        return "  <1%"
    if 0.99 < probability < 1.0:
        return " >99%"
    return f"{probability:5.0%}"


def number(value: float, unit: str = "", sigma: float = math.nan) -> str:
    """A value with its unit and standard error; what is not known is said to be so."""
    if math.isnan(value):
        return "unknown"
    spread = "" if math.isnan(sigma) else f" ± {sigma:.2g}"
    return f"{value:.4g}{spread} {unit}".rstrip()


def bar(fraction: float, cells: int = BAR_CELLS) -> str:
    """A bar as long as the fraction of its limit, at most full; empty for what is not known."""
    eighths = 0 if math.isnan(fraction) else round(8 * cells * min(max(fraction, 0.0), 1.0))
    full, rest = divmod(eighths, 8)
    return (EIGHTHS[-1] * full + (EIGHTHS[rest] if rest else "")).ljust(cells)
