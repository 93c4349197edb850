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

"""Verdict: one line, the possible faults with their reasons, the faults ruled out.

Texts and numbers are those of the records; nothing is stated with more certainty.
"""

from __future__ import annotations

import math
from collections.abc import Iterable

from flea_diag.operator.alarm import Alarm
from flea_diag.operator.panel import Line, Panel, clock, share
from flea_diag.operator.quantity import number
from flea_diag.operator.stand_view import compiling
from flea_diag.operator.state import OPEN, GroupStep, OperatorState
from flea_diag.operator.words import ENGLISH, language, later, tr
from flea_diag.wire.records import (
    NEVER_NS,
    OUTCOME_LEVEL,
    AmbiguityGroup,
    Candidate,
    Level,
    Outcome,
    Truth,
)

MOST_STEPS_SHOWN = 12
MOST_NAMES = 3
MOST_LISTED = 6
"""Longest list of faults that a sentence holds; of a longer one the first few are named."""
SENTENCES: dict[Outcome, str] = {
    Outcome.NOMINAL: later("No deviation."),
    Outcome.DETECTED: later("Fault detected, one of: {faults}."),
    Outcome.ISOLATED: later("The fault is {faults}."),
    Outcome.INDISTINGUISHABLE: later("One of {faults}."),
    Outcome.UNEXPLAINED: later("No fault of the catalogue explains the deviation."),
    Outcome.NOT_OBSERVABLE: later("Nothing can be observed."),
    Outcome.MODEL_MISMATCH: later("The calibration does not fit this actuator."),
    Outcome.DATA_UNUSABLE: later("The data are unusable."),
}
"""What an outcome says, in the language of the screen."""


def line(state: OperatorState, now_ns: int) -> str:
    """The verdict in one line, for a pipe or a log."""
    return heading(state, now_ns) + said(state, now_ns)


def change(state: OperatorState, now_ns: int) -> object:
    """What a new line is for: another order of the same faults is no change."""
    group = state.group
    if group is None:
        return None
    faults = tuple(candidate.fault for candidate in group.members)
    words = group.words.replace(", ".join(faults), "") if faults else group.words
    silent = state.silent(AmbiguityGroup, now_ns)
    return group.outcome, frozenset(faults), words, level_of(group), silent, group.source


def in_short(said: AmbiguityGroup | Alarm) -> str:
    """Words of a verdict; of many faults in a row the first few, and how many more.

    The diagnosis says them in English. Another language has a sentence for each outcome, in front.
    """
    faults = [member.fault for member in said.members]
    listed, few = ", ".join(faults), _few(faults)
    words = said.words
    if len(faults) > MOST_LISTED and listed in words:
        words = words.replace(listed, few)
    if language() == ENGLISH or not words:
        return words
    if tr(words) != words:
        return tr(words)
    return f"{tr(SENTENCES[said.outcome], faults=few)} ({words})"


def _few(faults: list[str]) -> str:
    if len(faults) <= MOST_LISTED:
        return ", ".join(faults)
    named, more = ", ".join(faults[:MOST_NAMES]), len(faults) - MOST_NAMES
    return tr("{faults} and {more} more", faults=named, more=more)


def heading(state: OperatorState, now_ns: int) -> str:
    """Time of the evidence and level of a verdict that is up to date; empty without one."""
    group = state.group
    if group is None or state.silent(AmbiguityGroup, now_ns):
        return ""
    return f"{clock(group.stamp_ns)} {level_of(group).name} "


def said(state: OperatorState, now_ns: int) -> str:
    """Outcome, possible faults and words of the verdict, or that there is none."""
    group = state.group
    if group is None:
        progress = compiling(state)
        return tr("no verdict yet") + (f": {progress}" if progress else "")
    if state.silent(AmbiguityGroup, now_ns):
        return tr("NO VERDICT: the diagnosis has stopped publishing")
    return f"{group.outcome.value}{_named(group)}: {in_short(group)}"


def level_of(group: AmbiguityGroup) -> Level:
    """Level of a verdict: STALE while the stand sends no data."""
    return Level.STALE if group.stale else OUTCOME_LEVEL[group.outcome]


def _named(group: AmbiguityGroup) -> str:
    """Number of possible faults, and their ids unless the verdict text names them all."""
    faults = [candidate.fault for candidate in group.members]
    if not faults:
        return ""
    if all(fault in group.words for fault in faults):
        return f" ({tr('{count} possible', count=len(faults))})"
    return f" ({tr('{count} possible', count=len(faults))}: {_few(faults)})"


def verdict(state: OperatorState, now_ns: int) -> Panel:
    """The verdict with its age and source."""
    group = state.group
    if group is None:
        why = compiling(state) or tr("waiting for ambiguity_group")
        return Panel("verdict", f"{tr('VERDICT')}  {tr('none yet')}: {why}", _stand_says(state))
    level, lines = level_of(group), []
    title = f"{tr('VERDICT')}  {level.name}  {group.outcome.value}  {in_short(group)}"
    if state.silent(AmbiguityGroup, now_ns):
        silent_s = state.stream(AmbiguityGroup).silent_s(now_ns)
        lines.append(Line(title, level))
        title = tr("NO VERDICT for {seconds:.0f} s: the last verdict follows", seconds=silent_s)
    elif group.stale:
        lines.append(Line(tr("STALE: no data from the stand; last verdict"), Level.STALE))
    if group.source != "live":
        lines.append(Line(tr("REPLAY: recorded data, not the live stand"), Level.WARN))
    told = tr(
        "episode {episode}, step {step}, number {number}, evidence up to {at} UTC, {source}",
        episode=group.episode, step=group.step, number=group.seq, at=clock(group.stamp_ns),
        source=tr(group.source),
    )  # fmt: skip
    lines.append(Line(told))
    if group.detected_stamp_ns != NEVER_NS:
        lines.append(Line(detected(clock(group.detected_stamp_ns), group.opened_by)))
        lines += _promise(group)
    return Panel("verdict", title, (*lines, *_stand_says(state)))


def detected(at: str, by: str) -> str:
    """When an episode was detected, and by what where that is known."""
    if not by:
        return tr("detected at {at} UTC", at=at)
    return tr("detected at {at} UTC by {by}", at=at, by=by)


def _promise(group: AmbiguityGroup) -> tuple[Line, ...]:
    """How often a healthy actuator may raise an alarm: as stated, and as far as recordings show."""
    stated, supported = group.stated_false_alarms_per_hour, group.supported_false_alarms_per_hour
    if math.isnan(stated):
        return ()
    bound = tr("no rate")
    if not math.isinf(supported):
        bound = tr("at most {rate:.2g}", rate=supported)
    words = tr(
        "false alarms per hour: {stated:g} stated, {bound} supported by the calibration",
        stated=stated, bound=bound,
    )  # fmt: skip
    return (Line(words),)


def _stand_says(state: OperatorState) -> tuple[Line, ...]:
    """Truth published by a simulated stand; no stage reads it."""
    truth = state.truth
    if truth is None or not truth.fault:
        return ()
    return (Line(truth_text(truth)),)


def truth_text(truth: Truth) -> str:
    """What the stand itself says is wrong with it."""
    said = f"{tr('truth (from the stand)')}: {truth.fault}"
    if truth.onset_ns == NEVER_NS:
        return said
    return f"{said} {tr('since')} {clock(truth.onset_ns)} UTC"


def possible(state: OperatorState) -> Panel | None:
    """Possible faults with their reasons, the most probable first."""
    group = state.group
    if group is None or not group.members or group.outcome not in OPEN:
        return None
    lines, alone = [], len(group.members) == 1
    for rank, entry in enumerate(group.members, 1):
        lines.append(Line(f"{rank}. {_candidate(entry, alone)}", level_of(group), entry.fault))
        if entry.reason:
            lines.append(Line(f"     {'':24} {entry.reason}"))
    return Panel("possible", standing_of(group).upper(), tuple(lines))


def standing_of(group: AmbiguityGroup) -> str:
    """Standing of the members of an open episode, with their number."""
    count = len(group.members)
    if group.outcome is Outcome.UNEXPLAINED:
        return tr("not ruled out ({count}), none explains the evidence well", count=count)
    return tr("possible ({count})", count=count)


def likely(entry: Candidate, alone: bool) -> str:
    """Probability of a fault among the remaining ones; "left" for the only one.

    The only remaining fault has probability 1 among those considered. That is not certainty, so
    no figure is shown.
    """
    return tr("left") if alone else share(entry.probability).strip()


def _candidate(entry: Candidate, alone: bool) -> str:
    known = not math.isnan(entry.size)
    size = ""
    if known:
        found = number(entry.size, entry.size_unit, entry.size_sigma)
        size = "  " + tr("size {size}", size=found)
    return f"{entry.fault:26} {likely(entry, alone):>5}  {entry.hypothesis}{size}"


def why(candidate: Candidate) -> Panel:
    """All evidence for and against one fault, in order of time."""
    lines = []
    for found in candidate.evidence:
        told = found.observed in found.verdict
        observed = "" if told or not found.observed else f" {found.observed}"
        path = f"  [{found.path}]" if found.path else ""
        lines.append(
            Line(f"{clock(found.stamp_ns)} {found.source}{observed}: {found.verdict}{path}")
        )
    return Panel("why", f"{tr('WHY')} {candidate.fault}: {candidate.reason}", tuple(lines))


def dropped(state: OperatorState) -> Panel | None:
    """Faults ruled out, grouped by reason."""
    group = state.group
    if group is not None and group.dropped_count:
        why = tr("no message on hypotheses yet, which holds the reasons")
        return Panel("dropped", f"{tr('RULED OUT')} ({group.dropped_count})", (Line(why),))
    if group is None or not group.dropped:
        return None
    lines = _by_reason((entry.fault, entry.reason) for entry in group.dropped)
    return Panel("dropped", f"{tr('RULED OUT')} ({len(group.dropped)})", lines)


def unseen(state: OperatorState) -> Panel | None:
    """Faults that this stand cannot show, or that were not looked for, grouped by reason."""
    group = state.group
    if group is None or not group.not_observable:
        return None
    lines = _by_reason(group.not_observable)
    return Panel("unseen", f"{tr('NOT LOOKED FOR')} ({len(group.not_observable)})", lines)


def _by_reason(faults: Iterable[tuple[str, str]]) -> tuple[Line, ...]:
    """A line for each reason, with all faults that have it."""
    reasons: dict[str, list[str]] = {}
    for fault, reason in faults:
        reasons.setdefault(reason, []).append(fault)
    return tuple(Line(f"{reason}: {', '.join(alike)}") for reason, alike in reasons.items())


def steps(state: OperatorState) -> Panel | None:
    """Reduction of the group of the open episode, step by step."""
    group = state.group
    if group is None or group.detected_stamp_ns == NEVER_NS:
        return None
    ours = [step for step in state.steps if step.episode == group.episode]
    lines = tuple(map(_step, ours[-MOST_STEPS_SHOWN:]))
    sizes = " → ".join(str(len(step.faults)) for step in ours)
    return Panel("steps", f"{tr('GROUP')}  {sizes}", lines) if lines else None


def _step(step: GroupStep) -> Line:
    names = [fault for fault, _ in step.dropped]
    shown = ", ".join(names[:MOST_NAMES])
    if len(names) > MOST_NAMES:
        shown = tr("{faults} and {more} more", faults=shown, more=len(names) - MOST_NAMES)
    told = f", {tr('ruled out')} {shown}" if names else ""
    left = len(step.faults)
    return Line(f"{clock(step.stamp_ns)} {step.outcome.value:17} {left:3} {tr('left')}{told}")
