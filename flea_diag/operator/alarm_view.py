"""Alarms as text: value, limit, evidence, times, and the operators' remarks."""

from __future__ import annotations

import math

from flea_diag.operator.alarm import OUT, REPLAY, SHELVED, Alarm, AlarmAction, Key, Member
from flea_diag.operator.alarm_rate import rate_text
from flea_diag.operator.panel import NS, Line, Panel, clock, share
from flea_diag.operator.quantity import number, statistic
from flea_diag.operator.state import OperatorState
from flea_diag.operator.verdict_view import in_short
from flea_diag.wire.records import NEVER_NS, OUTCOME_LEVEL, Level

MOST_SHOWN = 12
MOST_MARKS = 6


def key_text(key: Key) -> str:
    """Key of an alarm as one word."""
    return f"{key[0]}:{key[1]}"


def alarm_text(alarm: Alarm) -> str:
    """One alarm in one line: time, residual and limit, latest verdict."""
    return f"{clock(alarm.detected_ns)} UTC  {cause(alarm)}  {meaning(alarm)}"


def cause(alarm: Alarm) -> str:
    """Value, limit and test that opened the episode."""
    if not alarm.residual:
        return alarm.opened_by or "detection not received"
    return f"{alarm.residual}: {statistic(alarm.residual, alarm.value, alarm.limit)}, {alarm.test}"


def meaning(alarm: Alarm) -> str:
    """The latest verdict as published."""
    if not alarm.words:
        return "no verdict yet"
    return f"{alarm.outcome.value}: {in_short(alarm)}"


def member_text(member: Member) -> str:
    """One fault of the group, with its size where one was estimated."""
    known = not math.isnan(member.size)
    size = f", size {number(member.size, member.size_unit, member.size_sigma)}" if known else ""
    return f"{member.fault} {share(member.probability).strip()}{size}"


def lifetime(alarm: Alarm, open_key: Key | None) -> str:
    """Whether the alarm is active, or when it returned to normal and after how long."""
    if alarm.closed_ns != NEVER_NS:
        lasted_s = (alarm.closed_ns - alarm.detected_ns) / NS
        return f"returned {clock(alarm.closed_ns)[:-2]} after {duration(lasted_s)}"
    return "active" if alarm.key == open_key else "end not observed"


def duration(seconds: float) -> str:
    """Seconds, or hours, minutes and seconds."""
    if seconds < 60.0:
        return f"{seconds:.1f} s"
    minutes, rest = divmod(round(seconds), 60)
    hours, minutes = divmod(minutes, 60)
    return f"{hours} h {minutes:02d} min" if hours else f"{minutes} min {rest:02d} s"


def detail(alarm: Alarm, open_key: Key | None = None) -> Panel:
    """All stored information on one alarm."""
    lines = [Line(f"verdict  {meaning(alarm)}", _level(alarm))]
    if alarm.verdict_ns != NEVER_NS:
        lines.append(Line(f"given at {clock(alarm.verdict_ns)} UTC"))
    lines += [Line(f"possible {member_text(member)}") for member in alarm.members]
    lines += [
        Line(
            f"evidence {clock(row.since_ns)} {row.residual} magnitude {row.magnitude}, "
            f"slope {row.slope}"
        )
        for row in alarm.deviations
    ]
    lines.append(Line(f"episode  {lifetime(alarm, open_key)}"))
    lines.append(Line(f"standing {_standing(alarm)}"))
    lines += [Line(f"action   {action_text(done)}") for done in alarm.actions]
    lines += [Line(f"comment  {clock(c.stamp_ns)} {c.author}: {c.text}") for c in alarm.comments]
    title = f"ALARM  {clock(alarm.detected_ns)} UTC  {cause(alarm)}"
    return Panel("alarm", title, tuple(lines))


def alarms(state: OperatorState) -> Panel | None:
    """Episodes, the latest first; unacknowledged ones are shown at any age."""
    if not state.alarms:
        return None
    standing = [alarm for alarm in state.alarms if alarm.standing]
    latest = state.alarms[-MOST_SHOWN:]
    shown = [alarm for alarm in state.alarms if alarm.standing or alarm in latest]
    rate = rate_text(alarm.detected_ns for alarm in state.alarms)
    title = f"EPISODES  {len(state.alarms)} kept, {len(standing)} not acknowledged, {rate}"
    lines: list[Line] = []
    for alarm in reversed(shown):
        first = "FIRST OUT " if alarm.key == first_out(state.alarms) else ""
        text = f"{_flag(alarm)} {first}{alarm_text(alarm)}  {lifetime(alarm, state.open_key)}"
        lines.append(Line(text, _level(alarm), key_text(alarm.key)))
        lines += [Line(f"    {action_text(done)}") for done in alarm.actions]
        lines += [Line(f"    {clock(c.stamp_ns)} {c.author}: {c.text}") for c in alarm.comments]
    return Panel("episodes", title, tuple(lines))


def marks(state: OperatorState) -> Panel | None:
    """Marks of the operators, the latest first."""
    if not state.marks:
        return None
    lines = [
        Line(f"{clock(mark.stamp_ns)} {mark.author}: {mark.text}")
        for mark in reversed(state.marks[-MOST_MARKS:])
    ]
    return Panel("marks", f"MARKS  {len(state.marks)} kept", tuple(lines))


def action_text(done: AlarmAction) -> str:
    """What was done by whom, until when and why."""
    until = f" until {clock(done.until_ns)[:-4]} UTC" if done.until_ns != NEVER_NS else ""
    why = f": {done.text}" if done.text else ""
    return f"{clock(done.stamp_ns)[:-4]} {done.author}: {done.kind.value}{until}{why}"


def first_out(alarms: tuple[Alarm, ...]) -> Key | None:
    """The first of several alarms not acknowledged: what came later may follow from it."""
    standing = [alarm for alarm in alarms if alarm.standing and alarm.source != REPLAY]
    return standing[0].key if len(standing) > 1 else None


def _flag(alarm: Alarm) -> str:
    if alarm.silenced and alarm.standing:
        return {SHELVED: "shelved ", OUT: "out     "}[alarm.silenced]
    if alarm.standing:
        return "replay  " if not alarm.rings else "NEW     "
    return "acknowl."


def _standing(alarm: Alarm) -> str:
    if alarm.silenced and alarm.standing:
        return f"{alarm.silenced}: does not ring"
    if not alarm.standing:
        by = f" by {alarm.acknowledged_by}" if alarm.acknowledged_by else ""
        return f"acknowledged at {clock(alarm.acknowledged_ns)} UTC{by}"
    return "not acknowledged" if alarm.rings else "from a replay: does not ring"


def _level(alarm: Alarm) -> Level | None:
    return OUTCOME_LEVEL[alarm.outcome] if alarm.rings else None
