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

"""Whatever the records say, in any order: no screen says it more surely, or says anything else.

Faults, outcomes and sentences are words of their own kind, so that each one that stands on a
screen can be traced to the record that it came from.
"""

from __future__ import annotations

import math
import re
from html import unescape
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from support import examples

from flea_diag.configuration.screens import load_causal_map
from flea_diag.core.choice.diagnosis_tree import Node
from flea_diag.operator.alarm_view import detail
from flea_diag.operator.state import OPEN, OperatorState, aged, fold
from flea_diag.operator.verdict_view import line
from flea_diag.operator.view import page, view
from flea_diag.web.answer import chips, fresh_detection
from flea_diag.web.view import Tools, View
from flea_diag.wire import records as r
from flea_diag.wire.wording import words_of

START = 1_700_000_000 * 10**9
FAULTS = ("jam", "spall", "backlash", "winding_short", "winding_open", "supply_open")
TRUE_FAULT = "rotor_eccentricity"
UNSEEN = "supply_short"
SENTENCE = st.sampled_from(("words of the verdict", "other words"))
EDGES = st.sampled_from((0.0, 1.0, 0.9996, 0.99999, 0.996, 0.004, 1e-9, 0.5, math.nan))
SHARE = st.one_of(EDGES, st.floats(0.0, 1.0))
NUMBER = st.floats(width=32)
STAMP = st.integers(START, START + 60 * 10**9)


@st.composite
def groups(draw: st.DrawFn) -> r.AmbiguityGroup:
    outcome = draw(st.sampled_from(r.Outcome))
    order = draw(st.permutations(FAULTS))
    count = draw(st.integers(0, len(FAULTS))) if outcome in OPEN else 0
    last = draw(st.integers(count, len(FAULTS)))
    at_ns = draw(STAMP)
    return r.AmbiguityGroup(
        at_ns,
        outcome,
        episode=1 if outcome in OPEN else 0,
        step=draw(st.integers(0, 9)),
        seq=1,
        members=tuple(draw(candidates(name)) for name in order[:count]),
        dropped=tuple(draw(candidates(name)) for name in order[count:last]),
        detected_stamp_ns=at_ns if outcome in OPEN else r.NEVER_NS,
        words=draw(SENTENCE),
        calibration_sha256="",
        source=draw(st.sampled_from(("live", "replay"))),
        not_observable=((UNSEEN, "no sensor shows it"),) if draw(st.booleans()) else (),
        features_computed=draw(st.sampled_from(((), ("rms_1",)))),
        features_available=draw(st.sampled_from((0, 3))),
        stale=draw(st.booleans()),
    )


@st.composite
def candidates(draw: st.DrawFn, fault: str) -> r.Candidate:
    sizes = draw(st.sampled_from(((math.nan, math.nan, ""), (1.5, 0.25, "A"), (2.0, math.nan, ""))))
    return r.Candidate(fault, f"parameter_of_{fault}+", draw(SHARE), "it fits", (), *sizes)


@st.composite
def residuals(draw: st.DrawFn) -> r.Residual:
    columns = [tuple(draw(st.tuples(NUMBER, NUMBER))) for _ in range(3)]
    return r.Residual(draw(STAMP), ("parity_one", "parity_two"), *columns)


RECORDS = st.one_of(
    groups(),
    groups(),
    residuals(),
    st.builds(r.Scan, STAMP, st.just(("motor_current",)), st.tuples(NUMBER)),
    st.builds(
        r.Detection, STAMP, st.just(1), st.booleans(), st.just("parity_one"), NUMBER, NUMBER,
        st.just("mean of 50 samples"),
    ),
    st.builds(r.FeatureRequest, STAMP, st.just(1), st.just(1), st.just("rms_1"), STAMP, STAMP),
    st.builds(
        r.FeatureValue, STAMP, st.just(1), st.just(1), st.just("rms_1"), STAMP, STAMP, NUMBER,
        st.just("m/s^2"), st.sampled_from("+0-?"), NUMBER, NUMBER, st.just("a gap"), NUMBER,
    ),
    st.builds(r.Truth, STAMP, st.sampled_from((TRUE_FAULT, "")), st.just(r.NEVER_NS)),
    st.builds(
        r.Symbols, STAMP, st.just(1),
        st.tuples(st.builds(r.Symbol, st.just("parity_one"), st.just("+"), st.just("?"), STAMP)),
    ),
)  # fmt: skip
LEAF = Node((("jam", 1.0),), None, (), 0.0)


@pytest.fixture(scope="module")
def tools() -> Tools:
    return Tools(load_causal_map("actuator.yaml"), lambda *_, **__: LEAF)


def read(html: object) -> str:
    """What a person reads, tips of the pointer included."""
    tips = " ".join(re.findall(r'title="([^"]*)"', str(html)))
    return " ".join(unescape(f"{re.sub(r'<[^>]+>', ' ', str(html))} {tips}").split())


def named(text: str, names: tuple[str, ...] = FAULTS) -> set[str]:
    """Faults that a text names."""
    return {name for name in names if re.search(rf"(?<!\w){name}(?!\w)", text)}


class Screens:
    """Every text that is shown of a state, by the screen and panel that it stands on."""

    def __init__(self, state: OperatorState, now_ns: int, tools: Tools) -> None:
        panels = view(state, now_ns)
        self.console = {panel.name: panel.text() for panel in panels}
        drawn = View(tools)
        drawn.update(state, now_ns)
        self.web = {name: read(html) for name, html in drawn.drawn.items()}
        self.others = [line(state, now_ns), page(panels), read(chips(state, now_ns))]
        self.others += [detail(alarm).text() for alarm in state.alarms]
        self.others += [words_of(m, state.group).message for m in _members(state)]
        self.all = [*self.console.values(), *self.web.values(), *self.others]


def _members(state: OperatorState) -> tuple[r.Candidate, ...]:
    return state.group.members if state.group is not None else ()


@settings(max_examples=examples(150), deadline=None)
@given(records=st.lists(RECORDS, min_size=1, max_size=8), late_s=st.sampled_from((0.0, 1.5, 9.0)))
def test_no_screen_says_more_than_the_records(
    records: list[Any], late_s: float, tools: Tools
) -> None:
    state = OperatorState()
    for record in records:
        state = fold(state, record, START)
    now_ns = START + round(late_s * 1e9)
    state = aged(state, now_ns)
    screens = Screens(state, now_ns, tools)
    no_number_is_made_up(state, screens)
    no_fault_is_made_up(state, screens)
    no_verdict_is_made_up(state, screens, now_ns)
    limits_are_passed_where_they_are_passed(state, screens)


def no_number_is_made_up(state: OperatorState, screens: Screens) -> None:
    """What is unknown is said to be so, and no rounding makes a fault certain or impossible."""
    shares = {m.probability for m in _members(state)}
    shares |= {m.probability for alarm in state.alarms for m in alarm.members}
    for text in screens.all:
        assert not re.search(r"\b(nan|None)\b", text), text
        assert 1.0 in shares or not re.search(r"\b100 ?%|probability 1(?![\d.e])", text), text
        assert 0.0 in shares or not re.search(r"(?<![\d.])0 ?%", text), text


def no_fault_is_made_up(state: OperatorState, screens: Screens) -> None:
    """What is called possible is a member now; truth is the stand's own word."""
    members = {m.fault for m in _members(state)}
    for text in (screens.console.get("possible", ""), screens.web["answer"]):
        assert named(text) <= members, text
    for text in screens.all:
        told = text.count(TRUE_FAULT)
        truths = re.findall(rf"[Tt]ruth \(from the stand\): {TRUE_FAULT}", text)
        assert told == len(truths), text
    fresh = fresh_detection(state) is not None
    unexplained = state.group is not None and state.group.outcome is r.Outcome.UNEXPLAINED
    count = len(members)
    if count:
        words = f"not ruled out ({count})" if unexplained else f"possible ({count})"
        assert words in screens.console["possible"].lower()
        assert fresh or words in screens.web["answer"]


def no_verdict_is_made_up(state: OperatorState, screens: Screens, now_ns: int) -> None:
    """One outcome stands on top, the record's; old, silent and replayed verdicts are named so."""
    group, top = state.group, (screens.console["verdict"].splitlines()[0], screens.web["answer"])
    said = [{o.value for o in r.Outcome if re.search(rf"\b{o.value}\b", text)} for text in top]
    if group is None:
        assert said[0] == set()
        assert said[1] <= {"DETECTED"} if state.detection is not None else said[1] == set()
        assert "NO VERDICT YET" in top[1] or state.detection is not None
        return
    silent = state.silent(r.AmbiguityGroup, now_ns)
    both = (screens.console["verdict"], " ".join((screens.web["answer"], screens.web["chips"])))
    fresh = fresh_detection(state) is not None
    assert said[0] == (set() if silent else {group.outcome.value})
    assert said[1] == ({"DETECTED"} if fresh else {group.outcome.value})
    for text in both:
        assert not silent or "NO VERDICT" in text
        assert not group.stale or "STALE" in text or (silent and fresh)
        assert group.source != "replay" or "REPLAY" in text
        assert "LIVE" not in text or group.source == "live"
        assert "LIVE" not in text or not (silent or group.stale)
    if (silent or group.stale) and not fresh:
        assert not re.search(r"\b(OK|WARN|ERROR)\b", screens.web["answer"])
    ringing = sum(alarm.rings for alarm in state.alarms)
    assert all(alarm.source == "live" for alarm in state.alarms if alarm.rings)
    assert (f"{ringing} not acknowledged" in screens.web["chips"]) == (ringing > 0)
    assert all("acknowledged by" not in text for text in screens.all)


def limits_are_passed_where_they_are_passed(state: OperatorState, screens: Screens) -> None:
    """A residual is beyond its limit where the record has it so; without a limit nothing is."""
    record = state.residual
    if record is None:
        return
    beyond = sum(
        limit > 0.0 and abs(z) > limit for z, limit in zip(record.z, record.thresholds, strict=True)
    )
    assert screens.console["residuals"].count("BEYOND") == beyond
    unknown = sum(map(math.isnan, record.z))
    assert screens.console["residuals"].count("not formed") == unknown
