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

"""All stands of a screen in one list, the worst first."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from flea_diag.operator.alarm import REPLAY, Alarm
from flea_diag.operator.panel import Line, Panel, clock
from flea_diag.operator.state import OperatorState
from flea_diag.operator.verdict_view import heading, level_of, said
from flea_diag.operator.words import later, tr
from flea_diag.wire.records import AmbiguityGroup, Level

WORST_FIRST = (Level.ERROR, Level.STALE, Level.WARN, None, Level.OK)
"""Level of a stand's verdict; None: it has none yet."""
COUNTED = (
    (Level.ERROR, later("with a fault")),
    (Level.STALE, later("silent")),
    (Level.WARN, later("to look at")),
    (None, later("without a verdict")),
    (Level.OK, later("without deviation")),
)


MOST_EPISODES = 100


@dataclass(frozen=True, slots=True)
class StandRow:
    """One stand in the list.

    ``heading`` is the time of the evidence with the level, ``text`` the verdict or why there is
    none, ``age`` what makes it older than it looks; ``ringing`` alarms are not acknowledged.
    """

    name: str
    level: Level | None
    heading: str
    text: str
    age: str
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
    return StandRow(
        name,
        level,
        heading(state, now_ns),
        said(state, now_ns) + why,
        _age(state, now_ns),
        state.ringing,
    )


def _level(state: OperatorState, now_ns: int) -> Level | None:
    if state.group is None:
        return None
    return Level.STALE if state.silent(AmbiguityGroup, now_ns) else level_of(state.group)


def _age(state: OperatorState, now_ns: int) -> str:
    group = state.group
    if group is None:
        return ""
    if state.silent(AmbiguityGroup, now_ns):
        silent_s = state.stream(AmbiguityGroup).silent_s(now_ns)
        return tr(
            "evidence of {at} UTC, no verdict for {seconds:.0f} s",
            at=clock(group.stamp_ns), seconds=silent_s,
        )  # fmt: skip
    if group.stale:
        return tr("no data from the stand; last verdict")
    return tr("replay: recorded data") if group.source == REPLAY else ""


def _why_silent(state: OperatorState) -> str:
    """What the diagnosis of a stand says of itself, where it gives no verdict."""
    told = [h for name, h in state.health.items() if ": " not in name and h.level is not Level.OK]
    worst = max(told, key=lambda health: health.level, default=None)
    return f" ({worst.node.rpartition('/')[2]} {worst.message})" if worst else ""


def counts(rows: Sequence[StandRow]) -> tuple[tuple[Level | None, int, str], ...]:
    """Level, number and words of the stands of each level that occurs."""
    found = (
        (level, sum(row.level == level for row in rows), tr(words)) for level, words in COUNTED
    )
    return tuple(entry for entry in found if entry[1])


def hall(states: Mapping[str, OperatorState], now_ns: int) -> Panel:
    """The list as a panel; each line has the name of its stand as its key."""
    rows = stand_rows(states, now_ns)
    told = ", ".join(f"{count} {words}" for _, count, words in counts(rows))
    width = max((len(row.name) for row in rows), default=0)
    lines = tuple(
        Line(
            f"{row.name:{width}}  {_bell(row)}{row.heading}{row.text}", row.level or None, row.name
        )
        for row in rows
    )
    title = f"{tr('STANDS')}  " + (f"{len(rows)}: {told}" if rows else tr("none found"))
    return Panel("stands", title, lines)


def _bell(row: StandRow) -> str:
    return tr("[{count} to acknowledge] ", count=row.ringing) if row.ringing else ""


def all_alarms(states: Mapping[str, OperatorState]) -> tuple[tuple[str, Alarm], ...]:
    """Alarms of all stands with the name of theirs: those not acknowledged, then the latest."""
    found = ((name, alarm) for name, state in states.items() for alarm in state.alarms)
    order = sorted(found, key=lambda entry: (not entry[1].standing, -entry[1].detected_ns))
    return tuple(order[:MOST_EPISODES])
