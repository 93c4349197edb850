"""All stands of a screen in one list, the worst first."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from flea_diag.operator.panel import Line, Panel
from flea_diag.operator.state import OperatorState
from flea_diag.operator.verdict_view import level_of, line
from flea_diag.wire.records import AmbiguityGroup, Level

WORST_FIRST = (Level.ERROR, Level.STALE, Level.WARN, None, Level.OK)
"""Level of a stand's verdict; None: it has none yet."""
COUNTED = (
    (Level.ERROR, "with a fault"),
    (Level.STALE, "silent"),
    (Level.WARN, "to look at"),
    (None, "without a verdict"),
    (Level.OK, "without deviation"),
)


@dataclass(frozen=True, slots=True)
class StandRow:
    """One stand in the list; ``ringing`` alarms are not acknowledged."""

    name: str
    level: Level | None
    text: str
    ringing: int


def stand_rows(states: Mapping[str, OperatorState], now_ns: int) -> tuple[StandRow, ...]:
    """Rows of all stands, the worst first; ``states`` are by name of the stand."""
    rows = (_row(name, state, now_ns) for name, state in states.items())
    return tuple(
        sorted(rows, key=lambda row: (WORST_FIRST.index(row.level), not row.ringing, row.name))
    )


def _row(name: str, state: OperatorState, now_ns: int) -> StandRow:
    level = _level(state, now_ns)
    why = _why_silent(state) if level in (None, Level.STALE) else ""
    ringing = sum(alarm.rings for alarm in state.alarms)
    return StandRow(name, level, line(state, now_ns) + why, ringing)


def _level(state: OperatorState, now_ns: int) -> Level | None:
    if state.group is None:
        return None
    return Level.STALE if state.silent(AmbiguityGroup, now_ns) else level_of(state.group)


def _why_silent(state: OperatorState) -> str:
    """What the diagnosis of a stand says of itself, where it gives no verdict."""
    told = [h for name, h in state.health.items() if ": " not in name and h.level is not Level.OK]
    worst = max(told, key=lambda health: health.level, default=None)
    return f" ({worst.node.rpartition('/')[2]} {worst.message})" if worst else ""


def hall(states: Mapping[str, OperatorState], now_ns: int) -> Panel:
    """The list as a panel; each line has the name of its stand as its key."""
    rows = stand_rows(states, now_ns)
    counts = [(sum(row.level == level for row in rows), words) for level, words in COUNTED]
    told = ", ".join(f"{count} {words}" for count, words in counts if count)
    width = max((len(row.name) for row in rows), default=0)
    lines = tuple(
        Line(f"{row.name:{width}}  {_bell(row)}{row.text}", row.level or None, row.name)
        for row in rows
    )
    return Panel("stands", f"STANDS  {len(rows)}: {told}" if rows else "STANDS  none found", lines)


def _bell(row: StandRow) -> str:
    return f"[{row.ringing} to acknowledge] " if row.ringing else ""
