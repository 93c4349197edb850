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

"""What was judged, on every screen: of a stand whose load cell is whole, silent, or absent."""

from __future__ import annotations

from dataclasses import replace

import pytest
from support.screens.judgements import GONE, HALF, LOST, WHOLE, shown
from support.verdicts import START, group

from flea_diag.operator.judgement_view import (
    judged,
    judged_rows,
    judged_table,
    looked_for,
    looked_for_text,
    not_judged,
    not_looked_for,
    others_text,
)
from flea_diag.operator.state import OperatorState
from flea_diag.operator.view import page, view
from flea_diag.wire.messages.summary import summary
from flea_diag.wire.records import Cause, DataQuality, JudgedTest, Level, Outcome, Scan

ABOUT_LOAD = {"jam", "ball_nut_friction", "load_force_bias", "load_force_dead"}


def test_a_whole_stand_has_no_line_and_every_fault_was_looked_for() -> None:
    state, now_ns = shown(WHOLE)
    assert judged(state, now_ns) is None
    assert not_judged(judged_rows(state.quality)) == ()
    assert set(looked_for(state)) >= ABOUT_LOAD
    assert state.group is not None
    assert state.group.outcome is Outcome.NOMINAL
    assert "JUDGED" not in page(view(state, now_ns))


@pytest.mark.parametrize("load_cell", [HALF, GONE])
def test_what_rests_on_a_silent_load_cell_is_named_first_with_its_shares(load_cell: str) -> None:
    state, _ = shown(load_cell)
    rows = judged_rows(state.quality)
    assert {row.test for row in not_judged(rows)} == set(LOST)
    assert tuple(row.test for row in rows[: len(LOST)]) == LOST
    mechanical = rows[0]
    assert mechanical.recent_text == "0%"
    assert mechanical.run_text == {HALF: "35%", GONE: "0%"}[load_cell]
    assert (mechanical.state, mechanical.level) == ("not judged", Level.WARN)
    assert mechanical.why == "load_force lacks all of its readings"


def test_the_console_has_one_line_of_it_and_the_table_on_demand() -> None:
    state, now_ns = shown(GONE)
    panel = judged(state, now_ns)
    assert panel is not None
    (line,) = panel.lines
    assert line.text == (
        "not judged: parity_mechanical and 4 more: load_force lacks all of its readings"
    )
    assert line.text in page(view(state, now_ns))
    table = judged_table(state, now_ns)
    assert table is not None
    assert [row.text.split()[0] for row in table.lines[2 : 2 + len(LOST)]] == list(LOST)
    assert len(table.lines) == 2 + len(judged_rows(state.quality))
    assert table.lines[0].text.startswith("41 faults looked for: backlash, ")


def test_faults_that_were_not_looked_for_stand_together_by_their_reason() -> None:
    panels = {panel.name: panel for panel in view(*shown(GONE))}
    unseen = panels["unseen"]
    assert unseen.title == "NOT LOOKED FOR (15)"
    assert [line.text for line in unseen.lines if "jam" in line.text] == [
        "not looked for in the last 10 s: parity_mechanical (load_force lacks all of its readings):"
        " jam, ball_nut_friction, load_force_bias, load_force_drift, load_force_scaling"
    ]


def test_no_fault_is_both_looked_for_and_not() -> None:
    for load_cell in (WHOLE, HALF, GONE):
        state, _ = shown(load_cell)
        hidden = {fault for fault, _ in not_looked_for(state)}
        assert not hidden & set(looked_for(state))
        assert bool(hidden >= ABOUT_LOAD) == (load_cell != WHOLE)
        assert len(hidden) + len(looked_for(state)) == 56


def test_a_test_at_rest_has_nothing_to_judge_and_is_not_counted_as_judged() -> None:
    rest = JudgedTest("parity", 0.0, 0.5, True, Cause.AT_REST, "at rest in all of the scans")
    whole = JudgedTest("stuck", 1.0, 0.9996)
    rows = judged_rows(DataQuality(START, (), (), (whole, rest)))
    assert [(row.test, row.state, row.level) for row in rows] == [
        ("parity", "nothing to judge", Level.OK), ("stuck", "judged", Level.OK),
    ]  # fmt: skip
    assert rows[1].run_text == ">99%"
    table = judged_table(OperatorState(quality=DataQuality(START, (), (), (whole, rest))), START)
    assert table is not None
    assert table.title == "JUDGED  1 of 2 tests in the last 10 s"


def test_once_no_scan_arrives_it_is_of_the_past() -> None:
    state, now_ns = shown(GONE)
    assert state.streams["sensors/slow"].standing(now_ns) == "running"
    assert isinstance(state.scan, Scan)
    panel = judged(state, now_ns + 5 * 10**9)
    assert panel is not None
    assert (panel.lines[0].text, panel.lines[0].level) == (
        "no scan arrives; before that:", Level.STALE,
    )  # fmt: skip


def test_at_rest_the_words_of_the_verdict_say_why_all_others_were_not_looked_for() -> None:
    resting = replace(group(Outcome.NOT_OBSERVABLE), looked_for=("motor_current_noise",))
    state = OperatorState(group=resting)
    assert looked_for_text(state) == "1 faults looked for"
    assert others_text(state) == "words"
    assert others_text(OperatorState(group=group(Outcome.NOMINAL))) == ""


def test_what_no_record_says_is_not_made_up() -> None:
    assert judged(OperatorState(), 0) is None
    assert judged_table(OperatorState(), 0) is None
    state, _ = shown(WHOLE)
    assert state.group is not None
    brief = OperatorState(group=summary(state.group))
    assert looked_for_text(brief) == ""
