"""The answer first: the verdict in its own words, what it rests on, and what to do next."""

from __future__ import annotations

import math

from flea_diag.operator.advice_view import next_tests
from flea_diag.operator.alarm import REPLAY
from flea_diag.operator.state import OPEN, OperatorState
from flea_diag.operator.verdict_view import level_of, likely, standing_of
from flea_diag.web.markup import Markup, clock, joined, number, tag
from flea_diag.web.panels import CLASS, SHAPE
from flea_diag.wire.records import (
    NEVER_NS,
    AmbiguityGroup,
    Candidate,
    Detection,
    Level,
    Outcome,
    Residual,
    Scan,
)
from flea_diag.wire.wording import words_of

MOST_MEMBERS = 6
SILENT = "NO VERDICT any more: the isolator is silent, and this is the last one."
SILENT_ADVICE = "See why the isolator is silent."
MUTE = "(the bell is mute until you touch the page)"
LONG = 140
"""Words longer than that are set smaller."""

NEXT: dict[Outcome, str] = {
    Outcome.NOMINAL: "Nothing.",
    Outcome.DETECTED: "Go on with the motion: faults of motor and screw need motion both ways to "
    "be told apart.",
    Outcome.ISOLATED: "Look at that part. What held or spoke against each fault is under "
    "“Ambiguity group”.",
    Outcome.INDISTINGUISHABLE: "Look at all of these parts: nothing more is to be had from this "
    "evidence now.",
    Outcome.UNEXPLAINED: "Look at residuals and symbols: it may be two faults at once, or one that "
    "the catalogue lacks.",
    Outcome.NOT_OBSERVABLE: "Move the actuator.",
    Outcome.MODEL_MISMATCH: "Calibrate on nominal recordings of this stand.",
    Outcome.DATA_UNUSABLE: "Mend the channel that “Data quality” names.",
}
"""What each outcome asks of the people at the stand."""


def link(state: OperatorState, now_ns: int) -> tuple[str, str]:
    """What the page is joined to: class of the chip, and its words."""
    group = state.group
    if group is None:
        return "waiting", "… WAITING for the first verdict"
    if state.silent(AmbiguityGroup, now_ns):
        silent_s = state.stream(AmbiguityGroup).silent_s(now_ns)
        return "silent", f"✖ NO VERDICT for {silent_s:.0f} s: the isolator is silent"
    if group.stale or state.silent(Scan, now_ns):
        return "stale", "‖ STALE: the stand sends no data"
    if state.silent(Residual, now_ns):
        silent_s = state.stream(Residual).silent_s(now_ns)
        return "silent", f"✖ NO RESIDUALS for {silent_s:.0f} s: the observer is silent"
    if group.source == REPLAY:
        return "replay", "↻ REPLAY, not the stand"
    return "live", "● LIVE"


def chips(state: OperatorState, now_ns: int) -> Markup:
    """The line at the top: where this comes from, how far it goes, what waits for people."""
    kind, words = link(state, now_ns)
    ringing = sum(alarm.rings for alarm in state.alarms)
    replay = kind not in ("replay", "waiting") and _is_replay(state.group)
    stamp_ns = max((s.stamp_ns for s in (state.scan, state.group) if s is not None), default=-1)
    return tag(
        "div",
        tag("span", words, class_=f"chip {kind}", role="status"),
        tag("span", "↻ REPLAY", class_="chip replay") if replay else None,
        tag("span", f"{clock(stamp_ns, 0)} UTC", class_="soft"),
        tag("span", f"▲ {ringing} not acknowledged", class_="state warn") if ringing else None,
        tag("span", MUTE, class_="soft mute-note") if ringing else None,
        class_="chips",
    )


def _is_replay(group: AmbiguityGroup | None) -> bool:
    return group is not None and group.source == REPLAY


def fresh_detection(state: OperatorState) -> Detection | None:
    """A detection that no verdict has taken up yet: the isolator waits a little for the rest."""
    flag, group = state.detection, state.group
    if flag is None or not flag.detected:
        return None
    if group is None:
        return flag
    taken_up = group.detected_stamp_ns != NEVER_NS or group.stamp_ns >= flag.stamp_ns
    return None if taken_up else flag


def answer(state: OperatorState, now_ns: int) -> Markup:
    """The large panel on top."""
    flag, group = fresh_detection(state), state.group
    if flag is not None:
        head = _headline(Level.WARN, Outcome.DETECTED.value, "a fault; which, is being worked out")
        proof = tag("p", words_of(flag).message, class_="proof soft")
        return _card(Level.WARN, joined(head, proof, _next(NEXT[Outcome.DETECTED])), Markup())
    if group is None:
        head = _headline(Level.STALE, "NO VERDICT YET", "Nothing has come on ambiguity_group.")
        advice = "Start the diagnoser, or observer, isolator and extractor."
        return _card(Level.STALE, joined(head, _next(advice)), Markup())
    silent = state.silent(AmbiguityGroup, now_ns)
    level = Level.STALE if silent else level_of(group)
    head = _headline(level, group.outcome.value, group.words)
    advice = _next(SILENT_ADVICE if silent else _advice(state, group), _tests(state))
    gone = tag("p", SILENT, class_="proof") if silent else None
    left = joined(head, gone, *_proofs(state, group), advice)
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
        lines.append("REPLAY: this is a recording, not the stand as it is now.")
    if group.stale:
        lines.append("STALE: the stand sends no data; this is the last verdict.")
    if group.detected_stamp_ns != NEVER_NS:
        by = f" by {group.opened_by}" if group.opened_by else ""
        lines.append(f"Detected at {clock(group.detected_stamp_ns, 2)} UTC{by}.")
        lines.append(
            f"Evidence up to {clock(group.stamp_ns, 2)} UTC; episode {group.episode}, "
            f"step {group.step}."
        )
    truth = state.truth
    if truth is not None and truth.fault:
        onset = f" from {clock(truth.onset_ns)} UTC on" if truth.onset_ns != NEVER_NS else ""
        lines.append(f"The stand itself says: {truth.fault}{onset}.")
    return [tag("p", line, class_="proof soft") for line in lines]


def _advice(state: OperatorState, group: AmbiguityGroup) -> str:
    if group.stale:
        return "See why the stand sends no data."
    pending = [f for f in state.features if f.episode == group.episode and f.value is None]
    if group.outcome is Outcome.DETECTED and pending:
        return f"Go on with the motion; {pending[-1].name} has been asked for."
    return NEXT[group.outcome]


def _next(words: str, tests: Markup | None = None) -> Markup:
    return tag("div", tag("b", "What to do next"), words, tests, class_="next")


def _tests(state: OperatorState) -> Markup | None:
    """Tests that would split a group that is left, in the words of every screen."""
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
        return joined(tag("h2", "Cannot be seen here", class_="title"), *rows)
    return Markup()


def _members(group: AmbiguityGroup) -> Markup:
    shown, rest = group.members[:MOST_MEMBERS], group.members[MOST_MEMBERS:]
    more = tag("p", f"and {len(rest)} more", class_="soft") if rest else None
    alone = len(group.members) == 1
    return joined(
        tag("h2", f"Faults {standing_of(group)}", class_="title"),
        tag("table", *(_member(candidate, alone) for candidate in shown), class_="members"),
        more,
    )


def _member(candidate: Candidate, alone: bool) -> Markup:
    size = ""
    if not math.isnan(candidate.size):
        known = not math.isnan(candidate.size_sigma)
        spread = f" ± {number(candidate.size_sigma)}" if known else ""
        unit = "" if candidate.size_unit in ("", "1") else f" {candidate.size_unit}"
        size = f"size {number(candidate.size)}{spread}{unit}, "
    known = 0.0 <= candidate.probability <= 1.0
    width = candidate.probability if known else 0.0
    return tag(
        "tr",
        tag(
            "td",
            tag("span", candidate.fault, class_="fault"),
            tag("div", tag("i", style=f"width:{width:.1%}"), class_="meter"),
            tag("span", f"{size}{candidate.hypothesis}: {candidate.reason}", class_="soft"),
        ),
        tag("td", likely(candidate, alone), class_="share"),
    )
