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

"""What to do now: stop or go on, how urgent, which part, where, by which procedure.

What the catalogue states of the faults that are possible comes with the verdict; what an outcome
asks for whatever the faults stands here.
"""

from __future__ import annotations

from dataclasses import dataclass

from flea_diag.operator.advice_view import advice_text
from flea_diag.operator.panel import Line, Panel
from flea_diag.operator.state import OPEN, OperatorState
from flea_diag.operator.verdict_view import said
from flea_diag.operator.words import later, tr
from flea_diag.wire.records import AmbiguityGroup, Outcome

STOP, GO_ON = "stop", "go on"
RUN = {STOP: later("STOP THE STAND"), GO_ON: later("GO ON")}
URGENT = {
    "now": later("act now"),
    "soon": later("act this shift"),
    "planned": later("plan it for the next service"),
}
EACH = "; "
"""Between what a verdict says of each fault."""
UNKNOWN_PROCEDURE = later("No procedure is stated for this fault: ask whoever keeps the stand.")

ADVICE: dict[Outcome, str] = {
    Outcome.NOMINAL: later("No action required."),
    Outcome.DETECTED: later(
        "Continue the motion: motion in both directions is needed to separate faults of motor and "
        "screw."
    ),
    Outcome.ISOLATED: later(
        "Inspect this part. “Ambiguity group” lists the evidence for and against each fault."
    ),
    Outcome.INDISTINGUISHABLE: later(
        "Inspect all of these parts: the present evidence does not separate them further."
    ),
    Outcome.UNEXPLAINED: later(
        "Check residuals and symbols: two simultaneous faults, or a fault outside the catalogue, "
        "are possible."
    ),
    Outcome.NOT_OBSERVABLE: later("Move the actuator."),
    Outcome.MODEL_MISMATCH: later("Calibrate with nominal recordings of this stand."),
    Outcome.DATA_UNUSABLE: later("Repair the channel named under “Data quality”."),
}
"""Recommended action for each outcome."""
RUNS: dict[Outcome, tuple[str, str]] = {
    Outcome.DETECTED: (GO_ON, "now"),
    Outcome.ISOLATED: (STOP, "now"),
    Outcome.INDISTINGUISHABLE: (STOP, "now"),
    Outcome.UNEXPLAINED: (STOP, "now"),
    Outcome.NOT_OBSERVABLE: (GO_ON, "soon"),
    Outcome.MODEL_MISMATCH: (GO_ON, "soon"),
    Outcome.DATA_UNUSABLE: (GO_ON, "now"),
}
"""Stop or go on, and urgency, where the faults state neither: a verdict of older software."""


@dataclass(frozen=True, slots=True)
class Action:
    """What to do; texts are empty where they are not stated."""

    run: str
    urgency: str
    name: str
    part: str
    steps: tuple[str, ...]

    @property
    def headline(self) -> str:
        """Stop or go on, and how urgent it is; empty where nothing is to be done."""
        return f"{tr(RUN[self.run])}, {tr(URGENT[self.urgency])}" if self.run else ""


def action(state: OperatorState) -> Action | None:
    """What to do about the verdict; None without one."""
    group = state.group
    if group is None:
        return None
    stated = dict(group.to_do) if group.outcome in OPEN else {}
    run, urgency = RUNS.get(group.outcome, ("", ""))
    split = group.outcome is not Outcome.DETECTED
    # While the group is being split, the motion that splits it goes on; a stop is said at its end.
    if split and stated.get("run") in RUN and stated.get("urgency") in URGENT:
        run, urgency = stated["run"], stated["urgency"]
    return Action(
        run, urgency, _stated(stated, "name"), _stated(stated, "part"), _steps(group, stated)
    )


def _stated(stated: dict[str, str], what: str) -> str:
    """What the catalogue of the stand says, in the language of the screen where that has it."""
    return EACH.join(map(tr, stated.get(what, "").split(EACH)))


def _steps(group: AmbiguityGroup, stated: dict[str, str]) -> tuple[str, ...]:
    named = group.outcome in (Outcome.ISOLATED, Outcome.INDISTINGUISHABLE)
    if not named:
        return (tr(ADVICE[group.outcome]),)
    steps = [_stated(stated, "procedure") or tr(UNKNOWN_PROCEDURE)]
    if group.outcome is Outcome.INDISTINGUISHABLE:
        steps.insert(0, tr(ADVICE[group.outcome]))
        if group.next_tests:
            steps.append(tr("To split them: {test}.", test=advice_text(group.next_tests[0])))
        elif stated.get("next_test"):
            steps.append(tr("To split them: {test}", test=_stated(stated, "next_test")))
    return tuple(steps)


def to_do(state: OperatorState) -> Panel | None:
    """The panel of the console, first below the verdict."""
    found, group = action(state), state.group
    if found is None or group is None or group.stale or not found.run:
        return None
    lines = [Line(f"{what:9} {text}") for what, text in parts(found)]
    lines += [Line(f"{tr('do'):9} {step}") for step in found.steps]
    return Panel("todo", f"{tr('WHAT TO DO')}  {found.headline}", (*lines,))


def parts(found: Action) -> tuple[tuple[str, str], ...]:
    """What is wrong and where, as far as it is stated."""
    pairs = ((tr("what"), found.name), (tr("where"), found.part))
    return tuple(pair for pair in pairs if pair[1])


def spoken(state: OperatorState, now_ns: int) -> str:
    """Verdict, what to do, and alarms, for those who hear the page; nothing that ticks."""
    if state.group is None:
        return said(state, now_ns)
    alarms = f". {ringing_text(state.ringing)}" if state.ringing else ""
    return f"{said(state, now_ns)}{in_a_line(state)}{alarms}"


def ringing_text(count: int) -> str:
    """How many alarms nobody has acknowledged; "" if there are none."""
    if count == 1:
        return tr("one alarm not acknowledged")
    return tr("{count} alarms not acknowledged", count=count) if count else ""


def in_a_line(state: OperatorState) -> str:
    """What to do in the line of a verdict; empty where nothing is."""
    found = action(state)
    if found is None or not found.name or not found.run:
        return ""
    return f" | {found.headline}: {found.name} ({found.part})"
