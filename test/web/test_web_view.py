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

"""The panels say what the records say: a recorded jam, and records made up to mislead."""

from __future__ import annotations

import math
import re
from dataclasses import replace
from html import unescape

import pytest
from support.places import ROOT
from support.verdicts import FIRST, FLAG, LAST, NOMINAL, START, group, shown

from flea_diag.configuration.component import make_pipeline
from flea_diag.configuration.screens import load_causal_map, tree_planner
from flea_diag.configuration.stand import load_stand
from flea_diag.operator.action_view import ADVICE, UNKNOWN_PROCEDURE
from flea_diag.operator.advice_view import advice_text
from flea_diag.operator.state import SHOWN, OperatorState, fold
from flea_diag.stages.pipeline import Pipeline
from flea_diag.web.answer import answer, chips, link
from flea_diag.web.causal_paths import causal_paths, lit
from flea_diag.web.group_flow import MOST_STEPS, group_flow, steps
from flea_diag.web.history import answers, drops, signs
from flea_diag.web.panels import data_quality, dropped, episodes, streams
from flea_diag.web.symbol_matrix import symbol_matrix
from flea_diag.web.view import NO_EPISODE, PANELS, Tools, View
from flea_diag.wire.bags.bag import read_bag
from flea_diag.wire.messages.summary import summary
from flea_diag.wire.records import (
    AmbiguityGroup,
    Candidate,
    ChannelQuality,
    ChannelTable,
    DataQuality,
    Evidence,
    NextTest,
    Outcome,
    Quality,
    Record,
    Residual,
    Scan,
    Symbols,
    Truth,
    VibrationBlock,
)

BAG = ROOT / "bags" / "jam"
HOSTILE = "<img src=x onerror=alert(1)>\"'&"


@pytest.fixture(scope="module")
def told() -> list[Record]:
    """All that the diagnosis of the recorded jam says, with the scans."""
    pipeline = make_pipeline(load_stand())
    assert isinstance(pipeline, Pipeline)
    out: list[Record] = []
    for _, record in read_bag(BAG, (ChannelTable, Scan, VibrationBlock)):
        out += [] if isinstance(record, VibrationBlock) else [record]
        out += pipeline.handle(record)
    return [*out, *pipeline.finish()]


@pytest.fixture(scope="module")
def groups(told: list[Record]) -> list[AmbiguityGroup]:
    return [r for r in told if isinstance(r, AmbiguityGroup) and r.episode]


@pytest.fixture(scope="module")
def tools() -> Tools:
    return Tools(load_causal_map("actuator.yaml"), tree_planner("feature_table.yaml"))


def words(html: object) -> str:
    """What a person reads."""
    return " ".join(unescape(re.sub(r"<[^>]+>", " ", str(html))).split())


def said(state: OperatorState, now_ns: int = 0) -> str:
    """The large panel on top."""
    return words(answer(state, now_ns))


# --- the course of an episode, from its last verdict alone ---------------------------------


def test_the_last_verdict_tells_how_the_group_shrank(groups: list[AmbiguityGroup]) -> None:
    last = groups[-1]
    left = {c.fault for c in (*last.members, *last.dropped)}
    sizes = {len(left)}
    for drop in drops(last):
        left -= {c.fault for c in drop.candidates}
        sizes.add(len(left))
    assert left == {c.fault for c in last.members}
    # Each size that was published while it happened is among them.
    assert {len(g.members) for g in groups} <= sizes


def test_symbols_and_features_are_those_that_were_published(
    told: list[Record], groups: list[AmbiguityGroup]
) -> None:
    published = {
        (r.stamp_ns, s.residual, s.magnitude + s.slope)
        for r in told
        if isinstance(r, Symbols)
        for s in r.symbols
        if s.since_ns <= r.stamp_ns
    }
    found = {(s.stamp_ns, s.source, s.observed) for s in signs(groups[-1])}
    assert found
    assert found <= published
    assert tuple(sign.source for sign in answers(groups[-1])) == groups[-1].features_computed


def test_a_stream_of_many_steps_is_joined_and_loses_no_member() -> None:
    gone = tuple(
        Candidate(f"f{k}", "", 0.0, "r", (Evidence(START + k, f"s{k}", "+0", "", "no"),))
        for k in range(30)
    )
    rows = steps(replace(FIRST, dropped=gone))
    assert len(rows) == MOST_STEPS
    assert sum(step.gone for step in rows) == 30
    assert rows[0].before == 33


def test_a_page_without_hypotheses_names_the_faults_and_says_what_it_lacks(
    groups: list[AmbiguityGroup], tools: Tools
) -> None:
    """The summary alone: no course of the episode is made up, and it appears once they arrive."""
    first, last = groups[0], groups[-1]
    view = View(tools)
    state = shown(summary(first))
    view.update(state, 0)
    assert "No message on hypotheses yet" in words(view.drawn["group"])
    assert "No message on hypotheses yet" in words(view.drawn["symbols"])
    assert all(m.fault in words(view.drawn["answer"]) for m in first.members[:6])
    view.update(shown(summary(last), last.hypotheses(), state=state), 0)
    whole = View(tools)
    whole.update(shown(last, state=state), 0)
    assert view.drawn["group"] == whole.drawn["group"]
    assert view.drawn["symbols"] == whole.drawn["symbols"]


def test_what_goes_at_the_same_moment_goes_in_one_step() -> None:
    gone = tuple(
        Candidate(f"f{k}", "", 0.0, "r", (Evidence(START + k // 2, f"s{k}", "+0", "", "no"),))
        for k in range(4)
    )
    rows = steps(replace(FIRST, dropped=gone))
    assert [(row.before, row.gone, row.label) for row in rows] == [
        (7, 2, "2 findings"),
        (5, 2, "2 findings"),
    ]


def test_the_stream_is_drawn_with_its_counts(groups: list[AmbiguityGroup]) -> None:
    text = words(group_flow(groups[-1]))
    assert f"From {len(groups[-1].members) + len(groups[-1].dropped)} faults" in text
    for step in steps(groups[-1]):
        assert f"−{step.gone}" in text


def test_lit_paths_join_causes_still_possible_with_residuals_that_moved(
    groups: list[AmbiguityGroup], tools: Tools
) -> None:
    edges, causes = lit(tools.causal_map, groups[-1])
    hypothesis = groups[-1].members[0].hypothesis
    assert causes == set(re.findall(r"[a-z_]+", hypothesis))
    assert ("motor_speed", "parity_mechanical") in edges
    assert set(edges.values()) == {1}
    drawn = str(causal_paths(tools.causal_map, groups[-1]))
    assert drawn.count(' lit" stroke-width') == len(edges)
    assert ' lit"' not in str(causal_paths(tools.causal_map, None))


def test_the_tree_shows_the_branch_that_was_taken(
    told: list[Record], groups: list[AmbiguityGroup], tools: Tools
) -> None:
    view = View(tools)
    view.update(folded(told), 0)
    tree = view.drawn["tree"]
    (taken,) = re.findall(r'<li class="taken">(.*?)</li>', tree)
    (found,) = answers(groups[-1])
    observed = found.observed.replace("-", "−")  # a true minus, as wide as the plus
    assert words(taken) == f"✓ {observed} {groups[-1].members[0].fault}"
    assert found.source in words(tree)


def folded(records: list[Record]) -> OperatorState:
    state = OperatorState()
    for record in records:
        if isinstance(record, SHOWN):
            state = fold(state, record, record.stamp_ns)
    return state


# --- the answer -----------------------------------------------------------------------------


def test_the_answer_is_in_the_words_of_the_verdict(told: list[Record]) -> None:
    state = folded(told)
    assert state.group is not None
    assert state.detection is not None
    text = said(state)
    assert state.group.outcome.value in text
    assert state.group.words in text
    assert f"by {state.detection.residual}: z = {state.detection.z:.3g}, limit" in text
    assert "What to do now STOP THE STAND, act now Jammed screw ball screw, in the housing" in text
    assert dict(state.group.to_do)["procedure"] in text
    member = state.group.members[0]
    assert f"{member.fault} size {member.size:.1f} ± {member.size_sigma:.1f}" in text


@pytest.mark.parametrize("outcome", list(Outcome))
def test_every_outcome_has_its_words_its_level_and_advice(outcome: Outcome) -> None:
    text = said(shown(group(outcome)))
    assert outcome.value in text
    assert (UNKNOWN_PROCEDURE if outcome is Outcome.ISOLATED else ADVICE[outcome]) in text
    assert "possible (" not in text


def test_nothing_is_called_possible_that_is_not_held_so() -> None:
    assert "Faults possible (1)" in said(shown(NOMINAL, LAST))
    assert "winding_short" not in said(shown(NOMINAL, LAST))


def test_what_explains_nothing_is_not_called_possible() -> None:
    text = said(shown(replace(FIRST, outcome=Outcome.UNEXPLAINED)))
    assert "possible (" not in text
    assert "Faults not ruled out (3), none explains the evidence well" in text


def test_symbols_of_a_long_episode_keep_the_first_and_the_latest() -> None:
    seen = tuple(
        Evidence(START + k * 10**9, "r", "++" if k % 2 else "+-", "", "fits") for k in range(9)
    )
    text = words(
        symbol_matrix(replace(FIRST, members=(Candidate("f", "", 1.0, "", seen),)), ("r", "q"))
    )
    assert re.findall(r"\+(\d)\.00 s", text) == ["0", "5", "6", "7", "8"]
    assert "1 residuals without a symbol in this episode q" in text


def test_the_next_tests_are_those_of_the_verdict() -> None:
    tests = (NextTest("motion", "sweep", 6.0, 1.25), NextTest("feature", "crest_2", 1.0, 1.5))
    unsplit = replace(FIRST, outcome=Outcome.INDISTINGUISHABLE)
    text = said(shown(replace(unsplit, next_tests=tests)))
    assert all(advice_text(test) in text for test in tests)
    assert text.index("motion sweep") < text.index("feature crest_2")
    assert "sweep" not in said(shown(replace(FIRST, next_tests=tests)))
    sensor = (NextTest("sensor", "second encoder", math.nan, 1.0),)
    assert "by design no test splits" in said(shown(replace(unsplit, next_tests=sensor)))


def test_a_detection_is_told_before_its_verdict_and_without_a_fault() -> None:
    state = shown(replace(NOMINAL, stamp_ns=START - 1), FLAG)
    text = said(state)
    assert text.startswith("▲ DETECTED WARN")
    assert "parity_mechanical_dn: z = 6.5, limit 5, mean of 50 samples" in text
    assert "possible (" not in text
    assert "jam" in said(shown(FIRST, state=state))


def test_before_the_first_record_the_page_says_what_is_missing() -> None:
    assert "NO VERDICT YET" in said(OperatorState())
    assert "WAITING" in words(chips(OperatorState(), 0))


def test_live_stale_silent_and_replay_are_told_apart() -> None:
    scan = Scan(START, ("motor_current",), (0.0,))
    live = shown(scan, NOMINAL)
    assert link(live, START)[0] == "live"
    assert link(live, START + 2 * 10**9)[0] == "stale"
    assert link(live, START + 3 * 10**9)[0] == "silent"
    residual = Residual(START - 10**9, ("r",), (0.0,), (0.0,), (5.0,))
    assert link(shown(residual, scan, NOMINAL), START)[0] == "live"
    kind, told = link(shown(residual, scan, NOMINAL), START + 10**8)
    assert (kind, told) == ("silent", "✖ NO RESIDUALS for 1 s")
    assert link(shown(scan, replace(NOMINAL, stale=True)), START)[0] == "stale"
    replay = shown(scan, replace(NOMINAL, source="replay"))
    assert link(replay, START) == ("replay", "↻ REPLAY, not the live stand")
    assert "REPLAY" in words(chips(replay, START + 2 * 10**9))
    assert "STALE" in words(chips(replay, START + 2 * 10**9))


def test_a_stale_verdict_is_never_shown_as_fresh() -> None:
    text = said(shown(replace(LAST, stale=True)))
    assert "STALE: no data from the stand; last verdict." in text
    assert " ERROR " not in text


# --- ledgers, and all of them together ------------------------------------------------------


def test_the_ledger_names_the_bad_channel_first_with_its_reason() -> None:
    rows = (
        ChannelQuality("motor_current", Quality.GOOD, START, "", (("samples", 1),)),
        ChannelQuality("motor_voltage", Quality.BAD, START, "stuck at 3 V", (("nan", 7),)),
    )
    text = words(data_quality(shown(DataQuality(START, rows))))
    assert text.index("motor_voltage") < text.index("motor_current")
    assert "▲ bad" in text
    assert "stuck at 3 V 7 nan" in text


def test_a_stream_that_stopped_says_since_when() -> None:
    state = shown(Scan(START, ("a",), (0.0,)))
    assert "stale for 4 s" in words(streams(state, START + 4 * 10**9))


def test_why_lists_every_fault_with_its_evidence(groups: list[AmbiguityGroup]) -> None:
    text = words(dropped(groups[-1]))
    for candidate in (*groups[-1].members, *groups[-1].dropped):
        assert candidate.fault in text
        assert all(evidence.verdict in text for evidence in candidate.evidence)


def test_without_an_episode_the_pictures_say_so(tools: Tools) -> None:
    view = View(tools)
    view.update(shown(NOMINAL), START)
    for name in ("group", "symbols", "tree"):
        assert NO_EPISODE in view.drawn[name]


def test_a_verdict_that_repeats_draws_nothing_anew(told: list[Record], tools: Tools) -> None:
    view = View(tools)
    state = folded(told)
    assert state.group is not None
    view.update(state, START)
    before = dict(view.drawn)
    view.update(replace(state, group=replace(state.group, seq=state.group.seq + 1)), START)
    anew = [panel.name for panel in PANELS if view.drawn[panel.name] is not before[panel.name]]
    assert anew == []


def test_what_comes_from_outside_never_becomes_markup(tools: Tools) -> None:
    evil = Candidate(
        HOSTILE, HOSTILE, 0.5, HOSTILE, (Evidence(START, HOSTILE, "+0", "", HOSTILE, HOSTILE),),
        size_unit=HOSTILE,
    )  # fmt: skip
    verdict = replace(
        LAST, members=(evil,), dropped=(evil,), words=HOSTILE, features_available=3,
        features_computed=(), not_observable=((HOSTILE, HOSTILE),),
    )  # fmt: skip
    quality = DataQuality(START, (ChannelQuality(HOSTILE, Quality.BAD, START, HOSTILE),))
    state = shown(verdict, quality, Truth(START, HOSTILE, START), replace(FLAG, residual=HOSTILE))
    view = View(replace(tools, planner=lambda *_, **__: _leaf()))
    view.update(state, START)
    for name, drawn in view.drawn.items():
        assert "<img" not in drawn, name
        assert "onerror" not in re.sub(r"&[a-z#0-9]+;|[^&<>]", "", drawn), name
    assert HOSTILE in words(view.drawn["answer"])
    assert HOSTILE in words(episodes(state))


def _leaf() -> object:
    from flea_diag.core.choice.diagnosis_tree import Node

    return Node(((HOSTILE, 1.0),), None, (), 0.0)
