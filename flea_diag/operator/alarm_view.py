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

"""Alarms as text: value, limit, evidence, times, and the operators' remarks."""

from __future__ import annotations

import math

from flea_diag.operator.alarm import OUT, REPLAY, SHELVED, Alarm, AlarmAction, Key, Member
from flea_diag.operator.panel import Line, Panel, clock, share
from flea_diag.operator.quantity import number, statistic
from flea_diag.operator.shift.alarm_filter import EVERY, FILTERS
from flea_diag.operator.shift.alarm_rate import rate_text
from flea_diag.operator.state import OperatorState
from flea_diag.operator.verdict_view import in_short
from flea_diag.operator.words import later, tr
from flea_diag.wire.records import NEVER_NS, OUTCOME_LEVEL, SECOND_NS, Level, Symbol

MOST_SHOWN = 12
MOST_MARKS = 6
PRIORITY = {
    "now": later("priority 1"),
    "soon": later("priority 2"),
    "planned": later("priority 3"),
}
"""Urgency by the catalogue -> priority of the alarm."""


def key_text(key: Key) -> str:
    """Key of an alarm as one word."""
    return f"{key[0]}:{key[1]}"


def alarm_text(alarm: Alarm) -> str:
    """One alarm in one line: time, residual and limit, latest verdict."""
    return f"{clock(alarm.detected_ns)} UTC  {cause(alarm)}  {meaning(alarm)}"


def cause(alarm: Alarm) -> str:
    """Value, limit and test that opened the episode."""
    if not alarm.residual:
        return alarm.opened_by or tr("detection not received")
    return f"{alarm.residual}: {statistic(alarm.residual, alarm.value, alarm.limit)}, {alarm.test}"


def meaning(alarm: Alarm) -> str:
    """The latest verdict as published."""
    if not alarm.words:
        return "no verdict yet"
    return f"{alarm.outcome.value}: {in_short(alarm)}"


def member_text(member: Member, alone: bool) -> str:
    """One fault of the group, with its size where one was estimated."""
    size = ""
    if not math.isnan(member.size):
        found = number(member.size, member.size_unit, member.size_sigma)
        size = tr(", size {size}", size=found)
    likely = tr("left") if alone else share(member.probability).strip()
    return f"{member.fault} {likely}{size}"


def lifetime(alarm: Alarm, open_key: Key | None) -> str:
    """Whether the alarm is active, or when it returned to normal and after how long."""
    if alarm.closed_ns != NEVER_NS:
        lasted_s = (alarm.closed_ns - alarm.detected_ns) / SECOND_NS
        at, lasted = clock(alarm.closed_ns)[:-2], duration(lasted_s)
        return tr("returned {at} after {duration}", at=at, duration=lasted)
    return tr("active") if alarm.key == open_key else tr("end not observed")


def duration(seconds: float) -> str:
    """Seconds, or hours, minutes and seconds."""
    if seconds < 60.0:
        return f"{seconds:.1f} s"
    minutes, rest = divmod(round(seconds), 60)
    hours, minutes = divmod(minutes, 60)
    return f"{hours} h {minutes:02d} min" if hours else f"{minutes} min {rest:02d} s"


def detail(alarm: Alarm, open_key: Key | None = None) -> Panel:
    """All stored information on one alarm."""
    lines = [Line(f"{tr('verdict'):8} {meaning(alarm)}", _level(alarm))]
    if alarm.verdict_ns != NEVER_NS:
        lines.append(Line(f"{tr('given at'):8} {clock(alarm.verdict_ns)} UTC"))
    alone = len(alarm.members) == 1
    lines += [Line(f"{tr('possible'):8} {member_text(m, alone)}") for m in alarm.members]
    lines += [Line(f"{tr('evidence'):8} {_deviation(row)}") for row in alarm.deviations]
    lines.append(Line(f"{tr('episode'):8} {lifetime(alarm, open_key)}"))
    lines.append(Line(f"{tr('standing'):8} {standing_text(alarm)}"))
    lines += [Line(f"{tr('action'):8} {action_text(done)}") for done in alarm.actions]
    lines += [
        Line(f"{tr('comment'):8} {clock(c.stamp_ns)} {c.author}: {c.text}") for c in alarm.comments
    ]
    title = f"{tr('ALARM')}  {clock(alarm.detected_ns)} UTC  {cause(alarm)}"
    return Panel("alarm", title, tuple(lines))


def _deviation(row: Symbol) -> str:
    return tr(
        "{at} {residual} magnitude {magnitude}, slope {slope}",
        at=clock(row.since_ns), residual=row.residual, magnitude=row.magnitude, slope=row.slope,
    )  # fmt: skip


def alarms(state: OperatorState, chosen: str = EVERY) -> Panel | None:
    """Episodes that a filter shows, the latest first; unacknowledged ones at any age."""
    if not state.alarms:
        return None
    words, shows = FILTERS[chosen]
    latest = state.alarms[-MOST_SHOWN:]
    found = [alarm for alarm in state.alarms if shows(alarm, state.open_key)]
    kept = [a for a in found if chosen != EVERY or a.standing or a in latest]
    title = f"{tr('EPISODES')}  {tally(state)}"
    if chosen != EVERY:
        title += "  " + tr("shown: {filter}, {count}", filter=tr(words), count=len(kept))
    lines: list[Line] = []
    for alarm in reversed(kept):
        lines.append(Line(_row(alarm, state), _level(alarm), key_text(alarm.key)))
        lines += [Line(f"    {action_text(done)}") for done in alarm.actions]
        lines += [Line(f"    {clock(c.stamp_ns)} {c.author}: {c.text}") for c in alarm.comments]
    return Panel("episodes", title, tuple(lines))


def _row(alarm: Alarm, state: OperatorState) -> str:
    """An alarm in the list: how it stands, its priority, whether it came first, what it is."""
    first = f"{tr('FIRST OUT')} " if alarm.key == first_out(state.alarms) else ""
    priority = f"{tr(PRIORITY[alarm.urgency])} " if alarm.urgency in PRIORITY else ""
    said = f"{alarm_text(alarm)}  {lifetime(alarm, state.open_key)}"
    return f"{_flag(alarm)} {priority}{first}{said}"


def tally(state: OperatorState) -> str:
    """How many alarms there are, how many await somebody, and how fast they came in this shift."""
    standing = sum(alarm.standing for alarm in state.alarms)
    told = [
        tr("{count} kept", count=len(state.alarms)),
        tr("{count} not acknowledged", count=standing),
    ]
    if state.beyond:
        told.append(tr("{count} more of them in the journal", count=state.beyond))
    return ", ".join((*told, rate_text(state.shift_times)))


def marks(state: OperatorState) -> Panel | None:
    """Marks of the operators, the latest first."""
    if not state.marks:
        return None
    lines = [
        Line(f"{clock(mark.stamp_ns)} {mark.author}: {mark.text}")
        for mark in reversed(state.marks[-MOST_MARKS:])
    ]
    title = f"{tr('MARKS')}  {tr('{count} kept', count=len(state.marks))}"
    return Panel("marks", title, tuple(lines))


def action_text(done: AlarmAction) -> str:
    """What was done by whom, until when and why."""
    until = ""
    if done.until_ns != NEVER_NS:
        until = tr(" until {at} UTC", at=clock(done.until_ns)[:-4])
    why = f": {done.text}" if done.text else ""
    return f"{clock(done.stamp_ns)[:-4]} {done.author}: {tr(done.kind.value)}{until}{why}"


def first_out(alarms: tuple[Alarm, ...]) -> Key | None:
    """The first of several alarms not acknowledged: what came later may follow from it."""
    standing = [alarm for alarm in alarms if alarm.standing and alarm.source != REPLAY]
    return standing[0].key if len(standing) > 1 else None


def _flag(alarm: Alarm) -> str:
    if alarm.silenced and alarm.standing:
        return f"{tr({SHELVED: later('shelved'), OUT: later('out')}[alarm.silenced]):8}"
    if alarm.standing:
        return f"{tr('replay') if not alarm.rings else tr('NEW'):8}"
    return f"{tr('acknowl.'):8}"


def standing_text(alarm: Alarm) -> str:
    """Whether the alarm rings, and who has acknowledged it when."""
    if alarm.silenced and alarm.standing:
        return tr("{silenced}: does not ring", silenced=tr(alarm.silenced))
    if alarm.standing:
        return tr("not acknowledged") if alarm.rings else tr("from a replay: does not ring")
    at = clock(alarm.acknowledged_ns)[:-4]
    if not alarm.acknowledged_by:
        return tr("acknowledged {at} UTC", at=at)
    return tr("acknowledged {at} UTC by {author}", at=at, author=alarm.acknowledged_by)


def _level(alarm: Alarm) -> Level | None:
    return OUTCOME_LEVEL[alarm.outcome] if alarm.rings else None
