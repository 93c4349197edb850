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

"""What was judged: each test with its shares, and the faults that were looked for.

``judged_rows`` is what every screen, ``flea replay --json`` and ``/diagnostics`` show of the
ledger.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from flea_diag.operator.panel import Line, Panel, share
from flea_diag.operator.state import OperatorState
from flea_diag.operator.words import later, tr
from flea_diag.wire.records import DataQuality, Level, Outcome, Scan

JUDGED, NOT_JUDGED, IDLE = later("judged"), later("not judged"), later("nothing to judge")


@dataclass(frozen=True, slots=True)
class JudgedRow:
    """One test: in which share of the scans it had something to judge, and why not in the rest."""

    test: str
    last_10_s: float
    run: float
    judged: bool
    cause: str
    why: str

    @property
    def level(self) -> Level:
        """WARN where it had next to nothing of what it should have judged."""
        return Level.OK if self.judged else Level.WARN

    @property
    def state(self) -> str:
        """In a word: at rest, say, a test has nothing to judge, and nothing is lost by that."""
        if not self.judged:
            return NOT_JUDGED
        return JUDGED if self.last_10_s > 0.0 else IDLE

    @property
    def recent_text(self) -> str:
        """Share of the last 10 s; never rounded to nothing or to all."""
        return share(self.last_10_s).strip()

    @property
    def run_text(self) -> str:
        """Share of the run; never rounded to nothing or to all."""
        return share(self.run).strip()


def judged_rows(quality: DataQuality | None) -> tuple[JudgedRow, ...]:
    """Every test: those not judged first, then those judged in part, each in their own order."""
    rows = quality.judged if quality is not None else ()
    found = [JudgedRow(r.residual, r.recent, r.run, r.judged, r.cause.value, r.why) for r in rows]
    return tuple(sorted(found, key=lambda row: (row.judged, row.last_10_s >= 1.0)))


def not_judged(rows: Sequence[JudgedRow]) -> tuple[JudgedRow, ...]:
    """Those that had next to nothing of what they should have judged."""
    return tuple(row for row in rows if not row.judged)


def judged_text(rows: Sequence[JudgedRow]) -> str:
    """How many tests have judged, of all."""
    count = sum(row.state == JUDGED for row in rows)
    if count == len(rows):
        return tr("all {count} tests in the last 10 s", count=count)
    return tr("{judged} of {count} tests in the last 10 s", judged=count, count=len(rows))


def of_the_past(state: OperatorState, now_ns: int) -> str:
    """That nothing is judged any more since no scan arrives; empty while scans do."""
    return tr("no scan arrives; before that:") if state.silent(Scan, now_ns) else ""


def looked_for(state: OperatorState) -> tuple[str, ...]:
    """Faults of the catalogue that the verdict has looked for; empty: none, or not known."""
    return state.group.looked_for if state.group is not None else ()


def not_looked_for(state: OperatorState) -> tuple[tuple[str, str], ...]:
    """Faults that it has not looked for, each with the reason."""
    return state.group.not_observable if state.group is not None else ()


def looked_for_text(state: OperatorState) -> str:
    """How many faults were looked for; empty where that is not known."""
    found = looked_for(state)
    return tr("{count} faults looked for", count=len(found)) if found else ""


def others_text(state: OperatorState) -> str:
    """Why all faults that are in neither list were not looked for; empty: each is in one."""
    group = state.group
    if group is None or group.outcome not in (Outcome.NOT_OBSERVABLE, Outcome.MODEL_MISMATCH):
        return ""
    return group.words


def judged(state: OperatorState, now_ns: int) -> Panel | None:
    """One line that names what was not judged; none while everything is."""
    rows = judged_rows(state.quality)
    left = not_judged(rows)
    if not left:
        return None
    first, more = left[0].test, len(left) - 1
    told = tr("{faults} and {more} more", faults=first, more=more) if more else first
    line = Line(f"{tr(NOT_JUDGED)}: {told}: {left[0].why}", Level.WARN)
    return _panel(state, rows, (line,), now_ns)


def judged_table(state: OperatorState, now_ns: int) -> Panel | None:
    """Every test with its shares, and every fault that was looked for; None before the first."""
    rows = judged_rows(state.quality)
    if not rows:
        return None
    wide = max(len(row.test) for row in rows)
    lines = [
        Line(f"{row.test:{wide}} {row.recent_text:>5} {row.run_text:>5}  {row.why}".rstrip(),
             row.level or None)
        for row in rows
    ]  # fmt: skip
    heads = Line(f"{tr('test'):{wide}} {tr('10 s'):>5} {tr('run'):>5}  {tr('why not all')}")
    found = looked_for_text(state)
    faults = (Line(f"{found}: {', '.join(looked_for(state))}"),) if found else ()
    return _panel(state, rows, (*faults, heads, *lines), now_ns)


def _panel(
    state: OperatorState, rows: Sequence[JudgedRow], lines: tuple[Line, ...], now_ns: int
) -> Panel:
    past = of_the_past(state, now_ns)
    title = f"{tr('JUDGED')}  {judged_text(rows)}"
    return Panel("judged", title, (Line(past, Level.STALE), *lines) if past else lines)
