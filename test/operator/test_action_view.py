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

"""What to do now: said first, of the faults that are possible, and nothing that nobody stated."""

from __future__ import annotations

from dataclasses import replace

import pytest
from support.verdicts import FIRST, LAST, NOMINAL, shown

from flea_diag.operator.action_view import UNKNOWN_PROCEDURE, action, in_a_line
from flea_diag.operator.state import OperatorState
from flea_diag.operator.view import page, view
from flea_diag.wire.messages.summary import MOST_BYTES, summary
from flea_diag.wire.records import NextTest, Outcome

STATED = (
    ("run", "stop"), ("urgency", "now"), ("name", "Jammed screw"), ("part", "ball screw, inside"),
    ("procedure", "Stop, and lock the stand."), ("next_test", "A slow stroke."),
)  # fmt: skip
JAM = replace(LAST, to_do=STATED)
BOTH = replace(FIRST, outcome=Outcome.INDISTINGUISHABLE, to_do=STATED)


def test_it_comes_second_on_the_console_and_names_part_and_procedure() -> None:
    panels = view(shown(NOMINAL, JAM), 0)
    assert [panel.name for panel in panels[:2]] == ["verdict", "todo"]
    assert panels[1].text().splitlines() == [
        "WHAT TO DO  STOP THE STAND, act now",
        "what      Jammed screw",
        "where     ball screw, inside",
        "do        Stop, and lock the stand.",
    ]
    assert in_a_line(shown(JAM)) == " | STOP THE STAND, act now: Jammed screw (ball screw, inside)"
    brief = summary(JAM)
    assert brief.to_do == STATED, "the message that is repeated each second says it, too"
    assert len(str(brief.to_do)) < MOST_BYTES


def test_a_group_is_split_by_the_best_test_or_by_the_stated_one() -> None:
    best = NextTest("motion", "slow to and fro", 8.0, 1.0, ("jam / winding_short",))
    assert "To split them: motion slow to and fro" in page(
        view(shown(replace(BOTH, next_tests=(best,))), 0)
    )
    assert "To split them: A slow stroke." in page(view(shown(BOTH), 0))


def test_while_the_group_is_split_the_motion_goes_on() -> None:
    found = action(shown(replace(FIRST, to_do=STATED)))
    assert found is not None
    assert found.headline == "GO ON, act now"


@pytest.mark.parametrize("wrong", [(), (("run", "explode"), ("urgency", "now"))])
def test_a_verdict_that_states_nothing_is_taken_seriously(
    wrong: tuple[tuple[str, str], ...],
) -> None:
    found = action(shown(replace(LAST, to_do=wrong)))
    assert found is not None
    assert (found.headline, found.steps) == ("STOP THE STAND, act now", (UNKNOWN_PROCEDURE,))


def test_where_nothing_is_wrong_nothing_is_to_be_done() -> None:
    for state in (OperatorState(), shown(NOMINAL), shown(replace(JAM, stale=True))):
        assert all(panel.name != "todo" for panel in view(state, 0))
    assert in_a_line(shown(NOMINAL)) == ""
