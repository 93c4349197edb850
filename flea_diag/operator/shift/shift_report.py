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

"""The report of a shift as one page of HTML to read or print: alarms, what was done, evidence.

Pure: the same states give the same report, from a page that is open or from recordings.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from html import escape

from flea_diag.errors import visible
from flea_diag.operator.alarm import Alarm
from flea_diag.operator.alarm_view import PRIORITY, action_text, cause, detail, lifetime
from flea_diag.operator.panel import clock, date
from flea_diag.operator.shift.alarm_rate import rate_text
from flea_diag.operator.state import OperatorState
from flea_diag.operator.verdict_view import in_short
from flea_diag.operator.words import language, later, tr
from flea_diag.wire.records import NEVER_NS

STYLE = """
@page { size: A4 landscape; margin: 12mm; }
body { font: 13px/1.4 system-ui, sans-serif; color: #16191d; background: #fff; margin: 24px; }
h1 { font-size: 22px; margin: 0 0 4px; } h2 { font-size: 15px; margin: 18px 0 6px; }
table { border-collapse: collapse; width: 100%; } th, td { text-align: left; vertical-align: top;
padding: 3px 10px 3px 0; border-bottom: 1px solid #d5dae1; overflow-wrap: anywhere; }
th { overflow-wrap: normal; } td { min-width: 5.5em; }
dl { display: grid; grid-template-columns: max-content 1fr; gap: 2px 14px; margin: 8px 0; }
dd { margin: 0; overflow-wrap: anywhere; } td { white-space: pre-line; }
pre { font: 12px/1.4 ui-monospace, monospace; white-space: pre-wrap; margin: 0;
overflow-wrap: anywhere; } nav a { color: #00518a; margin-right: 12px; }
.evidence { break-before: page; } article { break-inside: avoid; margin-bottom: 14px; }
@media print { nav { display: none; } body { margin: 0; } }
@media (max-width: 700px) { body { margin: 10px; } .wide { overflow-x: auto; } }
"""
HEADS = (
    later("detected, UTC"), later("priority"), later("verdict"), later("by"), later("course"),
    later("acknowledged"), later("what was done"),
)  # fmt: skip
MARK_HEADS = (later("moment, UTC"), later("by"), later("text"))
STAND_HEADS = (
    later("verdict"), later("alarms"), later("not acknowledged"), later("rate"), later("marks")
)  # fmt: skip
STAND = later("stand")
HOURS = (8, 12, 24)
"""Shifts that a report is offered for."""
HOUR_NS = 3600 * 10**9

States = Mapping[str, OperatorState]
"""State of each stand, by its name."""


def of_hours(state: OperatorState, hours: float, now_ns: int) -> OperatorState:
    """What belongs to the last so many hours: its alarms and marks, and alarms still waiting."""
    since_ns = now_ns - round(hours * HOUR_NS)
    return replace(
        state,
        alarms=tuple(a for a in state.alarms if a.standing or a.detected_ns >= since_ns),
        alarm_times=tuple(at for at in state.alarm_times if at >= since_ns),
        marks=tuple(mark for mark in state.marks if mark.stamp_ns >= since_ns),
    )


def shift_report(
    states: States,
    title: str,
    made_ns: int,
    facts: Sequence[tuple[str, str]] = (),
    shifts: Sequence[tuple[str, str]] = (),
) -> str:
    """The report as a document of its own.

    Parameters
    ----------
    states
        One stand, or several, which come into the same tables.
    title
        What the report is of.
    made_ns
        Moment of the report.
    facts
        More lines of its head: versions.
    shifts
        Addresses and words of reports of other lengths, which are offered but not printed.
    """
    rows = sorted(
        ((name, alarm) for name, state in states.items() for alarm in state.alarms),
        key=lambda row: row[1].detected_ns,
    )
    head = _table(_headed(states, HEADS), [_row(*row, states) for row in rows])
    noted = [
        _of_stand(states, name, (_moment(mark.stamp_ns), mark.author, mark.text))
        for name, state in states.items()
        for mark in state.marks
    ]
    several = _table((STAND, *STAND_HEADS), [_stand(*item) for item in states.items()])
    evidence = "".join(_evidence(*row, states) for row in rows) or f"<p>{tr('none')}</p>"
    heading = _text(tr("Shift report: {stand}", stand=title))
    return (
        f'<!doctype html><html lang="{language()}"><meta charset="utf-8">'
        '<meta name="viewport" content="width=device-width">'
        f"<title>{heading}</title><style>{STYLE}</style><main><h1>{heading}</h1>{_nav(shifts)}"
        f"<dl>{''.join(map(_fact, (*_totals(states, made_ns), *facts)))}</dl>"
        f"{_section(later('Stands'), several) if len(states) > 1 else ''}"
        f"{_section(later('Alarms'), head)}"
        f"{_section(later('Marks'), _table(_headed(states, MARK_HEADS), noted))}"
        f'<section class="evidence"><h2>{tr("Evidence")}</h2>{evidence}</section></main>'
    )


def _section(title: str, content: str) -> str:
    return f'<h2>{tr(title)}</h2><div class="wide" tabindex="0" role="region" aria-label="{tr(title)}">{content}</div>'  # noqa: E501


def _nav(shifts: Sequence[tuple[str, str]]) -> str:
    links = "".join(f'<a href="{escape(to)}">{_text(words)}</a>' for to, words in shifts)
    return f'<nav aria-label="{tr("Shift")}">{links}</nav>' if links else ""


def _totals(states: States, made_ns: int) -> list[tuple[str, str]]:
    alarms = [alarm for state in states.values() for alarm in state.alarms]
    standing = sum(alarm.standing for alarm in alarms) + sum(s.beyond for s in states.values())
    times = [at for state in states.values() for at in state.alarm_times]
    count = max(len(times), len(alarms))
    told = tr("{count}, {standing} not acknowledged", count=count, standing=standing)
    if count > len(alarms):
        told += tr("; the table shows {count}, the journal keeps all", count=len(alarms))
    first_ns = min((*times, *(a.detected_ns for a in alarms)), default=NEVER_NS)
    only = next(iter(states.values())) if len(states) == 1 else OperatorState()
    return [
        (tr("alarms"), told),
        (tr("rate"), rate_text(times)),
        (tr("from"), _moment(first_ns)),
        (tr("made"), _moment(made_ns)),
        *_verdict(only),
    ]


def _moment(stamp_ns: int) -> str:
    """Date and time of day to the second, as page and journal have it."""
    return f"{date(stamp_ns)} {clock(stamp_ns)[:8]} UTC".lstrip()


def _verdict(state: OperatorState) -> list[tuple[str, str]]:
    group = state.group
    if group is None:
        return []
    pairs = [
        (tr("verdict"), f"{group.outcome.value}: {in_short(group)}"),
        (tr("source"), tr(group.source)),
    ]
    if group.calibration_sha256:
        pairs.append((tr("calibration"), f"sha256 {group.calibration_sha256}"))
    return pairs


def _stand(name: str, state: OperatorState) -> tuple[str, ...]:
    """One stand among several: its verdict with what it rests on, and its alarms."""
    verdict = "\n".join(f"{what} {said}" for what, said in _verdict(state))
    standing = sum(alarm.standing for alarm in state.alarms) + state.beyond
    count = max(len(state.alarms), len(state.alarm_times))
    rate = rate_text(state.alarm_times)
    return name, verdict, str(count), str(standing), rate, str(len(state.marks))


def _headed(states: States, heads: Sequence[str]) -> tuple[str, ...]:
    return (STAND, *heads) if len(states) > 1 else (*heads,)


def _of_stand(states: States, name: str, cells: tuple[str, ...]) -> tuple[str, ...]:
    """A row with its stand in front, where there are several."""
    return (name, *cells) if len(states) > 1 else cells


def _row(name: str, alarm: Alarm, states: States) -> tuple[str, ...]:
    acknowledged = tr("no")
    if not alarm.standing:
        acknowledged = f"{_moment(alarm.acknowledged_ns)} {alarm.acknowledged_by}"
    done = [action_text(action) for action in alarm.actions]
    done += [f"{clock(c.stamp_ns)[:8]} {c.author}: {c.text}" for c in alarm.comments]
    cells = (
        _moment(alarm.detected_ns),
        tr(PRIORITY.get(alarm.urgency, "")),
        f"{alarm.outcome.value}: {in_short(alarm)}",
        cause(alarm),
        lifetime(alarm, states[name].open_key),
        acknowledged,
        "\n".join(done),
    )
    return _of_stand(states, name, cells)


def _evidence(name: str, alarm: Alarm, states: States) -> str:
    panel = detail(alarm, states[name].open_key)
    lines = "\n".join(_text(line.text) for line in panel.lines)
    title = f"{name}  {panel.title}" if len(states) > 1 else panel.title
    return f"<article><h3>{_text(title)}</h3><pre>{lines}</pre></article>"


def _table(heads: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    if not rows:
        return f"<p>{tr('none')}</p>"
    top = "".join(f'<th scope="col">{tr(head)}</th>' for head in heads)
    cells = ("".join(f"<td>{_text(cell)}</td>" for cell in row) for row in rows)
    return f"<table><tr>{top}</tr>{''.join(f'<tr>{row}</tr>' for row in cells)}</table>"


def _fact(pair: tuple[str, str]) -> str:
    return f"<dt>{_text(pair[0])}</dt><dd>{_text(pair[1])}</dd>"


def _text(words: str) -> str:
    """Text of a record: escaped, control characters made visible but for ends of lines."""
    return "\n".join(escape(visible(line)) for line in words.split("\n"))
