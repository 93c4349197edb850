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

"""The panel of what was judged: of a stand whose load cell is whole, silent, or absent."""

from __future__ import annotations

import re
from dataclasses import replace
from html import unescape

import pytest
from support.screens.judgements import GONE, HALF, LOST, WHOLE, shown
from support.verdicts import NOMINAL, START

from flea_diag.configuration.languages import catalogue
from flea_diag.operator.state import OperatorState
from flea_diag.operator.words import speaking
from flea_diag.web.judgement import judgement
from flea_diag.web.view import PANELS, Shown
from flea_diag.wire.records import Cause, DataQuality, JudgedTest

HOSTILE = "<img src=x onerror=alert(1)>\"'&"


def words(html: object) -> str:
    """What a person reads."""
    return " ".join(unescape(re.sub(r"<[^>]+>", " ", str(html))).split())


def in_the_open(html: object) -> str:
    """What a person reads before anything is opened."""
    return words(re.sub(r"(</summary>).*?(</details>)", r"\1\2", str(html), flags=re.DOTALL))


def test_of_a_whole_stand_it_is_small_and_all_is_there_on_demand() -> None:
    drawn = judgement(*shown(WHOLE))
    text = in_the_open(drawn)
    assert text == (
        "✓ judged: 27 of 31 tests in the last 10 s Each of the 31 tests 49 faults looked for "
        "7 faults not looked for, and why"
    )
    assert "parity_mechanical ✓ judged" in words(drawn)
    assert "jam, ball_nut_friction, backlash" in words(drawn)


@pytest.mark.parametrize(("load_cell", "of_the_run"), [(HALF, "35%"), (GONE, "0%")])
def test_what_was_not_judged_stands_in_the_open(load_cell: str, of_the_run: str) -> None:
    drawn = judgement(*shown(load_cell))
    text = in_the_open(drawn)
    assert text.startswith("▲ judged: 22 of 31 tests in the last 10 s test state last 10 s run")
    row = f"parity_mechanical ▲ not judged 0% {of_the_run} load_force lacks all of its readings"
    assert row in text
    assert all(f"{test} ▲ not judged" in text for test in LOST)
    assert "parity_electrical" not in text
    assert "41 faults looked for" in text
    assert "jam not looked for in the last 10 s: parity_mechanical" in words(drawn)


def test_once_no_scan_arrives_it_is_of_the_past() -> None:
    state, now_ns = shown(WHOLE)
    text = in_the_open(judgement(state, now_ns + 5 * 10**9))
    assert text.startswith("‖ judged: no scan arrives; before that: 27 of 31 tests")


def test_nothing_is_said_before_anything_is_known() -> None:
    assert words(judgement(OperatorState(), 0)) == "no message on what was judged yet"


def test_what_can_be_opened_has_a_name_and_so_has_its_title() -> None:
    """By them it stays open, and the focus stays where it is, while shares are renewed."""
    drawn = str(judgement(*shown(GONE)))
    names = re.findall(r'<details data-name="([^"]+)">', drawn)
    assert names == ["judged", "looked-for", "not-looked-for"]
    assert re.findall(r'<summary data-name="([^"]+)">', drawn) == [f"{n}-title" for n in names]


def test_what_comes_from_outside_never_becomes_markup() -> None:
    row = JudgedTest(HOSTILE, 0.0, 0.0, False, Cause.MISSING, HOSTILE)
    group = replace(NOMINAL, looked_for=(HOSTILE,), not_observable=((HOSTILE, HOSTILE),))
    drawn = judgement(OperatorState(group=group, quality=DataQuality(START, (), (), (row,))), START)
    assert "<img" not in str(drawn)
    assert HOSTILE in words(drawn)


def test_it_is_drawn_anew_when_shares_or_the_verdict_change_and_not_when_they_repeat() -> None:
    state, now_ns = shown(GONE)
    assert state.quality is not None
    (panel,) = (panel for panel in PANELS if panel.name == "judged")
    before = panel.rests_on(Shown(state, now_ns, None))
    again = replace(state, quality=replace(state.quality, stamp_ns=now_ns))
    assert panel.rests_on(Shown(again, now_ns + 1, None)) == before
    fewer = replace(state, quality=replace(state.quality, judged=state.quality.judged[1:]))
    assert panel.rests_on(Shown(fewer, now_ns, None)) != before


def test_it_speaks_german() -> None:
    with speaking(*catalogue("de")):
        text = in_the_open(judgement(*shown(GONE)))
    assert text.startswith("▲ beurteilt: 22 von 31 Tests in den letzten 10 s Test Zustand")
    assert "▲ nicht beurteilt 0% 0%" in text
    assert "41 Fehler gesucht" in text
