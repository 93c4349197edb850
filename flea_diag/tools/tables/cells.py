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

"""Cells of tables of text: numbers as people write them, dates and times of day."""

from __future__ import annotations

import re
from datetime import datetime, timezone

MISSING = frozenset({
    "", "nan", "na", "n/a", "#n/a", "#na", "#num!", "#value!", "#div/0!", "#ref!", "null", "none",
    "-", "--", "---", "?", "nil", "missing", "-nan", "nan(ind)", "-nan(ind)", "1.#qnan", "1.#inf",
})  # fmt: skip
"""Cells that say that there is no reading."""
_GROUPED = re.compile(r"[+-]?[1-9]\d{0,2}(?:([,.' \u00a0\u202f])\d{3})(?:\1\d{3})*")
_GROUPS = {".": ",' \u00a0\u202f", ",": ".' \u00a0\u202f"}
"""Decimal mark -> marks that may group thousands."""
_ISO = re.compile(
    r"(\d{4})[-/](\d{1,2})[-/](\d{1,2})[T ](\d{1,2}):(\d\d)(?::(\d\d)(?:[.,](\d+))?)?"
    r"\s*(Z|UTC|[+-]\d\d:?\d\d)?"
)
_DAY_FIRST = re.compile(
    r"(\d{1,2})\.(\d{1,2})\.(\d{4})[T ](\d{1,2}):(\d\d)(?::(\d\d)(?:[.,](\d+))?)?()"
)
_CLOCK = re.compile(r"(\d{1,2}):(\d\d)(?::(\d\d)(?:[.,](\d+))?)?\s*([APap][Mm])?")
_DAYS: dict[tuple[int, int, int], float] = {}


def number(text: str, decimal: str = ".") -> float | None:
    """A number as it is written with this decimal mark; None if it is none."""
    text = text.strip()
    if decimal == ".":
        try:
            return float(text)
        except ValueError:
            pass
    whole, mark, rest = text.partition(decimal)
    grouped = _GROUPED.fullmatch(whole)
    if grouped is not None and grouped[1] in _GROUPS[decimal]:
        whole = whole.replace(grouped[1], "")
    try:
        return float(f"{whole}.{rest}" if mark else whole)
    except ValueError:
        return None


def moment_s(text: str) -> float | None:
    """Seconds since 1970 of a date with a time (UTC where it names no zone), or of a day; or None.

    A date is read year first, or day first with dots: 2024-03-05 10:00:00, 05.03.2024 10:00.
    """
    text = text.strip()
    found = _ISO.fullmatch(text)
    if found is not None:
        year, month, day = int(found[1]), int(found[2]), int(found[3])
    else:
        found = _DAY_FIRST.fullmatch(text)
        if found is None:
            return _of_day(text)
        year, month, day = int(found[3]), int(found[2]), int(found[1])
    start_s = _day_s(year, month, day)
    if start_s is None:
        return None
    seconds = 3600 * int(found[4]) + 60 * int(found[5]) + int(found[6] or 0)
    zone = found[8] or ""
    if zone[:1] in ("+", "-"):
        plain = zone.replace(":", "")
        seconds -= int(f"{zone[0]}1") * (3600 * int(plain[1:3]) + 60 * int(plain[3:5]))
    return start_s + seconds + float(f"0.{found[7] or 0}")


def _of_day(text: str) -> float | None:
    found = _CLOCK.fullmatch(text)
    if found is None:
        return None
    hour = int(found[1])
    if found[5]:
        hour = hour % 12 + 12 * (found[5].lower() == "pm")
    return 3600.0 * hour + 60 * int(found[2]) + int(found[3] or 0) + float(f"0.{found[4] or 0}")


def _day_s(year: int, month: int, day: int) -> float | None:
    key = year, month, day
    if key not in _DAYS:
        try:
            _DAYS[key] = datetime(year, month, day, tzinfo=timezone.utc).timestamp()
        except ValueError:
            return None
    return _DAYS[key]
