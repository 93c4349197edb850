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

"""The tables of the page: channels and streams, features, faults considered, episodes."""

from __future__ import annotations

import math
from collections.abc import Iterable

from flea_diag.operator.alarm import SHELVED, Alarm, Key
from flea_diag.operator.alarm_view import (
    PRIORITY,
    action_text,
    cause,
    first_out,
    key_text,
    lifetime,
    standing_text,
    tally,
)
from flea_diag.operator.panel import clock
from flea_diag.operator.quantity import number
from flea_diag.operator.shift.alarm_filter import is_active, matching
from flea_diag.operator.stand_view import quality_rows, stream_losses
from flea_diag.operator.state import AskedFeature, OperatorState
from flea_diag.operator.stream import AXIS, StreamState
from flea_diag.operator.verdict_view import in_short
from flea_diag.operator.words import later, tr
from flea_diag.web.markup import Markup, joined, moment, tag
from flea_diag.wire.records import (
    OUTCOME_LEVEL,
    AmbiguityGroup,
    Candidate,
    Health,
    Level,
    Outcome,
    Quality,
)
from flea_diag.wire.wording import QUALITY_LEVEL

SHAPE = {Level.OK: "✓", Level.WARN: "▲", Level.ERROR: "✖", Level.STALE: "‖"}
"""Symbol of each level, so that the level can be read without its colour."""
CLASS = {Level.OK: "ok", Level.WARN: "warn", Level.ERROR: "error", Level.STALE: "stale"}
NONE = "–"
TOTAL = "samples"
"""Counter not shown: it is not updated while a channel stays good."""
MOST_MARKS = 20
OVER = "○"
"""Symbol of an episode that is over."""
EPISODE_HEADS = (later("detected"), later("by"), later("verdict"), later("remarks"), "")
QUALITY_HEADS = (
    later("channel"), later("state"), later("since, UTC"), later("reason"), later("counters"),
)  # fmt: skip
STREAM_HEADS = (
    later("topic"), later("state"), later("rate"), later("missing"), later("late"), later("lost"),
)  # fmt: skip
NODE_HEADS = (
    later("node"), later("state"), later("CPU %"), later("memory MB"), later("lag ms"),
)  # fmt: skip
FEATURE_HEADS = (later("feature"), later("value"), later("nominal"), later("cost"))
NODE_NUMBERS = ("cpu_percent", "memory_mb", "worst_lag_ms")


def state_word(level: Level, word: str) -> Markup:
    """A word with the symbol and the colour of its level."""
    return tag("span", f"{SHAPE[level]} {word}", class_=f"state {CLASS[level]}")


def ledger(heads: Iterable[str], rows: Iterable[Iterable[object]]) -> Markup:
    """A table; cells are markup or text."""
    return tag(
        "table",
        tag("tr", *(tag("th", tr(head), scope="col") if head else tag("td") for head in heads)),
        *(tag("tr", *(tag("td", cell) for cell in row)) for row in rows),
        class_="ledger",
    )


# --- the stand --------------------------------------------------------------------------


def data_quality(state: OperatorState, now_ns: int = 0) -> Markup:
    """Every channel with its state, since when and why, and its counters."""
    if state.quality is None:
        return tag("p", tr("no message on data_quality yet"), class_="soft")
    rows = quality_rows(state, now_ns)
    order = sorted(rows, key=lambda row: row.quality is Quality.GOOD)
    cells = [
        (
            row.channel,
            state_word(QUALITY_LEVEL[row.quality], tr(row.quality.value)),
            clock(row.since_ns, 1),
            row.reason,
            ", ".join(f"{n} {tr(name)}" for name, n in row.counters if n and name != TOTAL)
            or tr("nothing"),
        )
        for row in order
    ]
    return ledger(QUALITY_HEADS, cells)


def streams(state: OperatorState, now_ns: int) -> Markup:
    """Rate and losses of each stream, and the health of the nodes."""
    rows = [_stream(state, stream, now_ns) for stream in state.streams.values()]
    nodes = [_node(health) for _, health in sorted(state.health.items())]
    table = ledger(STREAM_HEADS, rows)
    if not nodes:
        return table
    return joined(table, Markup("<br>"), ledger(NODE_HEADS, nodes))


def _stream(state: OperatorState, stream: StreamState, now_ns: int) -> tuple[object, ...]:
    standing = stream.standing(now_ns)
    level = Level.OK if standing == "running" else Level.STALE
    words = tr(standing)
    if standing == "stale":
        words = tr("stale for {seconds:.0f} s", seconds=stream.silent_s(now_ns))
    rate = "" if math.isnan(stream.rate_hz) else f"{stream.rate_hz:.1f} Hz"
    counts = (stream.missing, stream.late, stream_losses(state, stream))
    return (stream.name, state_word(level, words), rate, *counts)


def _node(health: Health) -> tuple[object, ...]:
    values = dict(health.values)
    word = state_word(health.level, health.message)
    return (health.node, word, *(values.get(name, "") for name in NODE_NUMBERS))


# --- the episode ------------------------------------------------------------------------


def dropped(group: AmbiguityGroup) -> Markup:
    """Every fault considered, with the evidence that kept or dropped it, step by step."""
    unexplained = group.outcome is Outcome.UNEXPLAINED
    stays = tr("not ruled out") if unexplained else tr("possible")
    rows = [
        _considered(candidate, standing)
        for candidates, standing in ((group.members, stays), (group.dropped, tr("dropped")))
        for candidate in candidates
    ]
    return tag(
        "details",
        tag("summary", tr("Reasons for each of the {count} faults", count=len(rows))),
        ledger((later("fault"), "", later("reason"), later("evidence")), rows),
        data_name="why",
    )


def _considered(candidate: Candidate, standing: str) -> tuple[object, ...]:
    evidence = joined(
        *(
            tag("span", f"{clock(e.stamp_ns, 1)} {e.source}: {e.verdict}", class_="comment")
            for e in candidate.evidence
        )
    )
    return (candidate.fault, standing, candidate.reason, evidence)


def features(state: OperatorState) -> Markup:
    """Features of the open episode: value, nominal range and cost, or why not computable."""
    group = state.group
    if group is None or not group.features_available:
        return tag("p", _without_features(state), class_="soft")
    ours = [entry for entry in state.features if entry.episode == group.episode and group.episode]
    seen = {entry.name for entry in ours}
    rows = [_feature(entry) for entry in ours]
    rows += [
        (name, tr("computed before this page was open"), "", "")
        for name in group.features_computed
        if name not in seen
    ]
    done = len(group.features_computed)
    rest = max(group.features_available - len(seen | set(group.features_computed)), 0)
    words = tr(
        "{done} of {count} features computed, {rest} not requested.",
        done=done, count=group.features_available, rest=rest,
    )  # fmt: skip
    line = tag("p", words, class_="soft")
    return joined(ledger(FEATURE_HEADS, rows) if rows else None, line)


def _without_features(state: OperatorState) -> str:
    """Why no feature is listed: none is asked for, or nothing could answer."""
    table = state.channels
    named = table is not None and any(row.name.startswith(AXIS) for row in table.channels)
    if state.level is not None or named:
        return tr("Vibration arrives; features are requested only while a fault is being isolated.")
    return tr("No features: this stand has no accelerometers.")


def _feature(entry: AskedFeature) -> tuple[object, ...]:
    name, value = entry.name, entry.value
    if value is None:
        return (name, tr("requested, no answer yet"), "", "")
    if math.isnan(value.value):
        return (name, tr("not computable: {reason}", reason=value.reason), "", "")
    low = number(value.nominal_low, unknown=NONE)
    nominal = tr("{low} to {high}", low=low, high=number(value.nominal_high, unknown=NONE))
    return (
        name,
        f"{number(value.value, value.unit)}  ({value.symbol})",
        nominal,
        number(value.cost_ms, "ms"),
    )


# --- history ----------------------------------------------------------------------------


def episodes(state: OperatorState) -> Markup:
    """All stored episodes, the latest first; those not acknowledged on top."""
    if not state.alarms:
        return joined(tag("p", tr("No episode so far."), class_="soft"), _marks(state))
    order = sorted(state.alarms, key=lambda alarm: (not alarm.standing, -alarm.detected_ns))
    first = first_out(state.alarms)
    rows = [episode_row(alarm, state.open_key, first=alarm.key == first) for alarm in order]
    rate = tag("p", f"{tally(state)}.", class_="soft rate")
    return joined(rate, ledger(EPISODE_HEADS, rows), _marks(state))


def _marks(state: OperatorState) -> Markup | None:
    """Marks of the operators, the latest first."""
    if not state.marks:
        return None
    rows = [(clock(mark.stamp_ns, 1), mark.author, mark.text) for mark in reversed(state.marks)]
    return joined(
        Markup("<br>"),
        ledger((later("marked, UTC"), later("by"), later("text")), rows[:MOST_MARKS]),
    )


def episode_row(
    alarm: Alarm, open_key: Key | None, stand: str = "", first: bool = False
) -> tuple[object, ...]:
    """Cells of an episode; its buttons name the stand where several are listed."""
    active = is_active(alarm, open_key)
    verdict = joined(
        state_word(OUTCOME_LEVEL[alarm.outcome], alarm.outcome.value)
        if active
        else tag("span", f"{OVER} {alarm.outcome.value}", class_="state over"),
        tag("span", in_short(alarm) or tr("no verdict yet"), class_="comment"),
    )
    said = [tag("span", action_text(done), class_="comment") for done in alarm.actions]
    said += [
        tag("span", f"{clock(c.stamp_ns, 0)} {c.author}: {c.text}", class_="comment")
        for c in alarm.comments
    ]
    return (
        tag(
            "div",
            moment(alarm.detected_ns),
            tag("span", tr("first out"), class_="state") if first else None,
            tag("span", tr(PRIORITY[alarm.urgency]), class_="comment")
            if alarm.urgency in PRIORITY
            else None,
            tag("span", lifetime(alarm, open_key), class_="comment"),
            tag("span", standing_text(alarm), class_="comment"),
            data_is=" ".join(matching(alarm, open_key)),
        ),
        cause(alarm),
        verdict,
        joined(*said),
        _buttons(f"{stand} {key_text(alarm.key)}".lstrip(), alarm),
    )


def _buttons(name: str, alarm: Alarm) -> Markup:
    """What can be done to an alarm now."""
    found = [_button(tr("Comment"), name, opens="comment")]
    if alarm.undoable:
        found.insert(0, _button(tr("Undo"), name, act="undo"))
    if alarm.standing:
        found.insert(0, _button(tr("Acknowledge"), name, act="ack"))
    if alarm.silenced == SHELVED:
        found.append(_button(tr("Unshelve"), name, act="unshelve"))
    elif alarm.standing:
        found.append(_button(tr("Shelve"), name, opens="shelve"))
    return tag("div", *found, class_="actions")


def _button(words: str, name: str, act: str | None = None, opens: str | None = None) -> Markup:
    return tag("button", words, type="button", data_act=act, data_opens=opens, data_alarm=name)
