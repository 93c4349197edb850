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

"""Text panels with a level per line, and the formatting of times, shares and bars.

Independent of the output: terminal, pipe and page render the same panels.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from flea_diag.wire.records import NEVER_NS, SECOND_NS, Level

BAR_CELLS = 14
EIGHTHS = " ▏▎▍▌▋▊▉█"
DAYS = 719_468
"""From 1 March of the year 0 to 1970; a year that begins in March ends with its leap day."""
DAYS_400_YEARS = 146_097


@dataclass(frozen=True, slots=True)
class Line:
    """One line of text; its level sets the colour, which repeats what the text says.

    A line with a ``key`` begins a selectable entry; the lines without a key after it belong to it.
    """

    text: str
    level: Level | None = None
    key: str = ""


@dataclass(frozen=True, slots=True)
class Panel:
    """A titled block of lines; ``name`` is its constant identifier."""

    name: str
    title: str
    lines: tuple[Line, ...] = ()

    def text(self) -> str:
        """The panel in plain text."""
        return "\n".join([self.title, *(line.text for line in self.lines)])


def clock(stamp_ns: int, digits: int = 3) -> str:
    """Time of day in UTC, with so many digits of the second's fraction."""
    if stamp_ns == NEVER_NS:
        return "--:--:--"
    seconds = stamp_ns // SECOND_NS % 86400
    hours, minutes = seconds // 3600, seconds // 60 % 60
    fraction = f".{stamp_ns % SECOND_NS:09d}"[: digits + 1] if digits else ""
    return f"{hours:02d}:{minutes:02d}:{seconds % 60:02d}{fraction}"


def date(stamp_ns: int) -> str:
    """Day in UTC, without a clock's library (Hinnant, days from civil); empty for none."""
    if stamp_ns == NEVER_NS:
        return ""
    era, day = divmod(stamp_ns // SECOND_NS // 86400 + DAYS, DAYS_400_YEARS)
    of_era = (day - day // 1460 + day // 36524 - day // 146096) // 365
    of_year = day - (365 * of_era + of_era // 4 - of_era // 100)
    march = (5 * of_year + 2) // 153
    month = march + 3 if march < 10 else march - 9
    year = 400 * era + of_era + (month <= 2)
    return f"{year:04d}-{month:02d}-{of_year - (153 * march + 2) // 5 + 1:02d}"


def share(probability: float) -> str:
    """A probability in percent, 5 characters; rounding never gives 0 % or 100 %."""
    if not 0.0 <= probability <= 1.0:
        return "    ?"
    if 0.0 < probability < 0.01:
        return "  <1%"
    if 0.99 < probability < 1.0:
        return " >99%"
    return f"{probability:5.0%}"


def bar(fraction: float, cells: int = BAR_CELLS) -> str:
    """A bar of the fraction of the limit, clipped at full length; empty for an unknown value."""
    eighths = 0 if math.isnan(fraction) else round(8 * cells * min(max(fraction, 0.0), 1.0))
    full, rest = divmod(eighths, 8)
    return (EIGHTHS[-1] * full + (EIGHTHS[rest] if rest else "")).ljust(cells)
