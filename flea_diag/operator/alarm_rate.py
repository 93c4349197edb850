"""How many alarms came how fast: a flood is more than a person can act on (EEMUA 191)."""

from __future__ import annotations

from collections.abc import Iterable

WINDOW_NS = 600_000_000_000
FLOOD = 10
"""Alarms in ten minutes above which one operator is flooded, by EEMUA 191."""


def most_in_a_window(detected_ns: Iterable[int]) -> int:
    """Largest number of alarms within any ten minutes."""
    stamps, first, most = sorted(detected_ns), 0, 0
    for last, stamp_ns in enumerate(stamps):
        while stamp_ns - stamps[first] >= WINDOW_NS:
            first += 1
        most = max(most, last - first + 1)
    return most


def rate_text(detected_ns: Iterable[int]) -> str:
    """The largest rate in a sentence, and whether it is a flood."""
    most = most_in_a_window(detected_ns)
    flood = f": a flood, above {FLOOD}" if most > FLOOD else ""
    return f"at most {most} alarms within 10 min{flood}"
