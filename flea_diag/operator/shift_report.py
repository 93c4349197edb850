"""The report of a shift as one page of HTML to read or print: alarms, what was done, evidence.

Pure: the same state gives the same report, from a page that is open or from a recording.
"""

from __future__ import annotations

from collections.abc import Sequence
from html import escape

from flea_diag.errors import visible
from flea_diag.operator.alarm import Alarm, Key
from flea_diag.operator.alarm_rate import rate_text
from flea_diag.operator.alarm_view import action_text, cause, detail, lifetime
from flea_diag.operator.panel import clock
from flea_diag.operator.state import OperatorState
from flea_diag.operator.verdict_view import in_short
from flea_diag.wire.records import NEVER_NS

STYLE = """
@page { size: A4 landscape; margin: 12mm; }
body { font: 13px/1.4 system-ui, sans-serif; color: #16191d; background: #fff; margin: 24px; }
h1 { font-size: 22px; margin: 0 0 4px; } h2 { font-size: 15px; margin: 18px 0 6px; }
table { border-collapse: collapse; width: 100%; } th, td { text-align: left; vertical-align: top;
padding: 3px 10px 3px 0; border-bottom: 1px solid #d5dae1; overflow-wrap: anywhere; }
dl { display: grid; grid-template-columns: max-content 1fr; gap: 2px 14px; margin: 8px 0; }
dd { margin: 0; } pre { font: 12px/1.4 ui-monospace, monospace; white-space: pre-wrap; margin: 0; }
.evidence { break-before: page; } article { break-inside: avoid; margin-bottom: 14px; }
"""
HEADS = ("detected, UTC", "priority", "verdict", "by", "course", "acknowledged", "what was done")


def shift_report(
    state: OperatorState, stand: str, made_ns: int, facts: Sequence[tuple[str, str]] = ()
) -> str:
    """The report as a document of its own; ``facts`` are more lines of its head: versions."""
    alarms = state.alarms
    open_alarms = sum(alarm.standing for alarm in alarms)
    head = [
        ("alarms", f"{len(alarms)}, {open_alarms} not acknowledged"),
        ("rate", rate_text(alarm.detected_ns for alarm in alarms)),
        ("from", clock(min((a.detected_ns for a in alarms), default=NEVER_NS)) + " UTC"),
        ("made", clock(made_ns) + " UTC"),
        *_verdict(state),
        *facts,
    ]
    rows = "".join(_row(alarm, state.open_key) for alarm in alarms)
    marks = "".join(
        f"<tr><td>{clock(m.stamp_ns)}</td><td>{_text(m.author)}</td><td>{_text(m.text)}</td></tr>"
        for m in state.marks
    )
    evidence = "".join(_evidence(alarm, state.open_key) for alarm in alarms)
    title = _text(f"Shift report: {stand}")
    return (
        f'<!doctype html><html lang="en"><meta charset="utf-8"><title>{title}</title>'
        f"<style>{STYLE}</style><main><h1>{title}</h1><dl>{''.join(map(_fact, head))}</dl>"
        f"<h2>Alarms</h2>{_table(HEADS, rows)}"
        f"<h2>Marks</h2>{_table(('moment, UTC', 'by', 'text'), marks)}"
        f'<section class="evidence"><h2>Evidence</h2>{evidence or "<p>none</p>"}</section></main>'
    )


def _verdict(state: OperatorState) -> list[tuple[str, str]]:
    group = state.group
    if group is None:
        return [("verdict", "none")]
    pairs = [("verdict", f"{group.outcome.value}: {in_short(group)}"), ("source", group.source)]
    if group.calibration_sha256:
        pairs.append(("calibration", f"sha256 {group.calibration_sha256}"))
    return pairs


def _row(alarm: Alarm, open_key: Key | None) -> str:
    acknowledged = (
        "no" if alarm.standing else f"{clock(alarm.acknowledged_ns)} {alarm.acknowledged_by}"
    )
    done = [action_text(action) for action in alarm.actions]
    done += [f"{clock(c.stamp_ns)} {c.author}: {c.text}" for c in alarm.comments]
    cells = (
        clock(alarm.detected_ns),
        alarm.urgency,
        f"{alarm.outcome.value}: {in_short(alarm)}",
        cause(alarm),
        lifetime(alarm, open_key),
        acknowledged,
        "\n".join(done),
    )
    return f"<tr>{''.join(f'<td><pre>{_text(cell)}</pre></td>' for cell in cells)}</tr>"


def _evidence(alarm: Alarm, open_key: Key | None) -> str:
    panel = detail(alarm, open_key)
    lines = "\n".join(_text(line.text) for line in panel.lines)
    return f"<article><h3>{_text(panel.title)}</h3><pre>{lines}</pre></article>"


def _table(heads: Sequence[str], rows: str) -> str:
    if not rows:
        return "<p>none</p>"
    top = "".join(f'<th scope="col">{head}</th>' for head in heads)
    return f"<table><tr>{top}</tr>{rows}</table>"


def _fact(pair: tuple[str, str]) -> str:
    return f"<dt>{_text(pair[0])}</dt><dd>{_text(pair[1])}</dd>"


def _text(words: str) -> str:
    """Text of a record: escaped, control characters made visible but for ends of lines."""
    return "\n".join(escape(visible(line)) for line in words.split("\n"))
