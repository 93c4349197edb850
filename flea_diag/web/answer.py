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

"""Main panel: the verdict, its basis, and the recommended action."""

from __future__ import annotations

import math

from flea_diag.operator.action_view import ADVICE, GO_ON, STOP, action, parts
from flea_diag.operator.advice_view import next_tests
from flea_diag.operator.alarm import REPLAY
from flea_diag.operator.alarm_view import action_text
from flea_diag.operator.panel import clock
from flea_diag.operator.quantity import number, statistic
from flea_diag.operator.stand_view import compiling
from flea_diag.operator.state import OPEN, OperatorState
from flea_diag.operator.verdict_view import (
    detected,
    in_short,
    level_of,
    likely,
    standing_of,
    truth_text,
)
from flea_diag.operator.words import later, tr
from flea_diag.web.markup import Markup, joined, moment, tag
from flea_diag.web.panels import CLASS, SHAPE
from flea_diag.wire.records import (
    NEVER_NS,
    TAKEN_OVER,
    AmbiguityGroup,
    Candidate,
    Detection,
    Level,
    Outcome,
    RemarkKind,
    Residual,
    Scan,
)

MOST_MEMBERS = 6
TO_DO = later("What to do now")
SILENT = later("NO VERDICT: the diagnosis has stopped publishing; this is its last verdict.")
SILENT_ADVICE = later("Check the nodes of the diagnosis: “Streams and nodes” names those that run.")
MUTE = later("(bell muted until the first click or key on this page)")
NO_MESSAGE = later("No message on ambiguity_group.")
START = later("Start the diagnoser, or observer, isolator and extractor.")
WAIT = later("Wait: the first start after an installation compiles; later ones do not.")
REQUESTED = later("Continue the motion; feature {feature} is requested.")
LONG = 140
"""Verdicts longer than this are set in a smaller size."""


def link(state: OperatorState, now_ns: int) -> tuple[str, str]:
    """State of the data source: CSS class and text of the chip."""
    group = state.group
    if group is None:
        return "waiting", tr("… WAITING for the first verdict")
    if state.silent(AmbiguityGroup, now_ns):
        silent_s = state.stream(AmbiguityGroup).silent_s(now_ns)
        words = tr("✖ NO VERDICT for {seconds:.0f} s: the diagnosis has stopped", seconds=silent_s)
        return "silent", words
    if group.stale or state.silent(Scan, now_ns):
        return "stale", tr("‖ STALE: no data from the stand")
    if state.silent(Residual, now_ns):
        silent_s = state.stream(Residual).silent_s(now_ns)
        return "silent", tr("✖ NO RESIDUALS for {seconds:.0f} s", seconds=silent_s)
    if group.source == REPLAY:
        return "replay", tr("↻ REPLAY, not the live stand")
    return "live", tr("● LIVE")


def chips(state: OperatorState, now_ns: int) -> Markup:
    """Status line at the top: source, time of the latest data, alarms not acknowledged."""
    kind, words = link(state, now_ns)
    replay = kind not in ("replay", "waiting") and _is_replay(state.group)
    stamp_ns = max((s.stamp_ns for s in (state.scan, state.group) if s is not None), default=-1)
    return tag(
        "div",
        tag("span", words, class_=f"chip {kind}"),
        tag("span", tr("↻ REPLAY"), class_="chip replay") if replay else None,
        moment(stamp_ns, 0, class_="soft both"),
        _out_of_service(state),
        *unacknowledged(state.ringing),
        class_="chips",
    )


def unacknowledged(ringing: int, where: str = "") -> tuple[Markup, ...]:
    """How many alarms ring, and that the bell is mute while nobody has touched the page."""
    if not ringing:
        return ()
    words = f"▲ {tr('{count} not acknowledged', count=ringing)}{where}"
    mute = tag(
        "span",
        tag("span", tr(MUTE), class_="long"),
        tag("span", tr("(muted)"), class_="short", aria_hidden="true"),
        class_="soft mute-note",
    )
    return tag("span", words, class_="state warn"), mute


def _out_of_service(state: OperatorState) -> Markup | None:
    done = state.service
    if done is None or done.kind is not RemarkKind.OUT_OF_SERVICE:
        return None
    return tag("span", tr("◼ ALARMS OUT OF SERVICE"), class_="chip stale", title=action_text(done))


def _is_replay(group: AmbiguityGroup | None) -> bool:
    return group is not None and group.source == REPLAY


def fresh_detection(state: OperatorState) -> Detection | None:
    """A detection not yet included in a verdict: the isolator waits for records of that time."""
    flag, group = state.detection, state.group
    if flag is None or not flag.detected:
        return None
    if group is None:
        return flag
    taken_up = group.detected_stamp_ns != NEVER_NS or group.stamp_ns >= flag.stamp_ns
    return None if taken_up else flag


def found_by(flag: Detection) -> str:
    """Residual, value, limit and test of a detection."""
    if flag.test == TAKEN_OVER:
        return tr("An episode is resumed that was open before.")
    return f"{flag.residual}: {statistic(flag.residual, flag.z, flag.threshold)}, {flag.test}"


def answer(state: OperatorState, now_ns: int) -> Markup:
    """Main panel at the top of the page."""
    flag, group = fresh_detection(state), state.group
    if flag is not None:
        head = _headline(
            Level.WARN, Outcome.DETECTED.value, tr("fault detected, isolation in progress")
        )
        proof = tag("p", found_by(flag), class_="proof soft")
        return _card(Level.WARN, joined(head, proof, _next(tr(ADVICE[Outcome.DETECTED]))), Markup())
    if group is None:
        progress = compiling(state)
        words, advice = tr(NO_MESSAGE), tr(START)
        if progress:
            words, advice = tr("The {progress}.", progress=progress), tr(WAIT)
        head = _headline(Level.STALE, tr("NO VERDICT YET"), words)
        return _card(Level.STALE, joined(head, _next(advice)), Markup())
    silent = state.silent(AmbiguityGroup, now_ns)
    level = Level.STALE if silent else level_of(group)
    head = _headline(level, group.outcome.value, in_short(group))
    gone = tag("p", tr(SILENT), class_="proof") if silent else None
    if silent or group.stale:
        advice = _next(tr(SILENT_ADVICE) if silent else tr("Check why the stand sends no data."))
    else:
        advice = _action(state, group)
    left = joined(head, gone, advice, *_proofs(state, group))
    return _card(level, left, _right(group))


def _card(level: Level, left: Markup, right: Markup) -> Markup:
    return tag("div", tag("div", left), tag("div", right), class_=f"answer {CLASS[level]}")


def _headline(level: Level, outcome: str, words: str) -> Markup:
    return joined(
        tag(
            "h1",
            tag("span", SHAPE[level], class_="shape", aria_hidden="true"),
            outcome,
            tag("span", level.name, class_="level"),
        ),
        tag("p", words, class_="words long" if len(words) > LONG else "words"),
    )


def _proofs(state: OperatorState, group: AmbiguityGroup) -> list[Markup]:
    lines = []
    if group.source == REPLAY:
        lines.append(tr("REPLAY: recorded data, not the live stand"))
    if group.stale:
        lines.append(tr("STALE: no data from the stand; last verdict"))
    if group.detected_stamp_ns != NEVER_NS:
        flag = state.detection
        ours = flag is not None and flag.stamp_ns == group.detected_stamp_ns and flag.residual
        opened_by = found_by(flag) if flag is not None and ours else group.opened_by
        lines.append(detected(clock(group.detected_stamp_ns, 2), opened_by))
        rests = tr(
            "evidence up to {at} UTC; episode {episode}, step {step}",
            at=clock(group.stamp_ns, 2), episode=group.episode, step=group.step,
        )  # fmt: skip
        lines.append(rests)
    if state.truth is not None and state.truth.fault:
        lines.append(truth_text(state.truth))
    return [tag("p", f"{line[:1].upper()}{line[1:]}.", class_="proof soft") for line in lines]


def _action(state: OperatorState, group: AmbiguityGroup) -> Markup:
    """What to do, before anything else is said."""
    found = action(state)
    if found is None:
        return Markup()
    pending = [f for f in state.features if f.episode == group.episode and f.value is None]
    steps = found.steps
    if group.outcome is Outcome.DETECTED and pending:
        steps = (tr(REQUESTED, feature=pending[-1].name),)
    css = {STOP: "stop", GO_ON: "go"}.get(found.run, "")
    headline = tag("p", found.headline, class_=f"run {css}") if found.headline else None
    about = tag("p", *(tag("span", text) for _, text in parts(found)), class_="part")
    told = [tag("p", step) for step in steps]
    return tag(
        "div", tag("h2", tr(TO_DO), class_="title"), headline, about, *told, _tests(state),
        class_="next",
    )  # fmt: skip


def _next(words: str) -> Markup:
    return tag("div", tag("h2", tr(TO_DO), class_="title"), words, class_="next")


def _tests(state: OperatorState) -> Markup | None:
    """Tests that would split the remaining group, worded as on the other screens."""
    panel = next_tests(state)
    if panel is None:
        return None
    rows = tag("ul", *(tag("li", line.text) for line in panel.lines))
    return joined(tag("p", panel.title), rows)


def _right(group: AmbiguityGroup) -> Markup:
    if group.members and group.outcome in OPEN:
        return _members(group)
    if group.not_observable:
        rows = [tag("p", f"{fault}: {why}", class_="soft") for fault, why in group.not_observable]
        return joined(tag("h2", tr("Not looked for"), class_="title"), *rows)
    return Markup()


def _members(group: AmbiguityGroup) -> Markup:
    shown, rest = group.members[:MOST_MEMBERS], group.members[MOST_MEMBERS:]
    more = tag("p", tr("and {count} more", count=len(rest)), class_="soft") if rest else None
    alone = len(group.members) == 1
    return joined(
        tag("h2", f"{tr('Faults')} {standing_of(group)}", class_="title"),
        tag("table", *(_member(candidate, alone) for candidate in shown), class_="members"),
        more,
    )


def _member(candidate: Candidate, alone: bool) -> Markup:
    size = ""
    if not math.isnan(candidate.size):
        found = number(candidate.size, candidate.size_unit, candidate.size_sigma)
        size = f"{tr('size {size}', size=found)}, "
    why = f"{candidate.hypothesis}: {candidate.reason}" if candidate.reason else ""
    known = 0.0 <= candidate.probability <= 1.0
    width = candidate.probability if known else 0.0
    return tag(
        "tr",
        tag(
            "td",
            tag("span", candidate.fault, class_="fault"),
            tag("div", tag("i", style=f"width:{width:.1%}"), class_="meter"),
            tag("span", f"{size}{why}", class_="soft"),
        ),
        tag("td", likely(candidate, alone), class_="share"),
    )
