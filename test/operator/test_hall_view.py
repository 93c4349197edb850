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

"""The list of all stands: order, words, counts."""

from __future__ import annotations

from dataclasses import replace

from support.verdicts import FIRST, LAST, NOMINAL, START, shown

from flea_diag.operator.hall_view import hall, stand_rows
from flea_diag.operator.state import OperatorState
from flea_diag.wire.records import Health, Level, Outcome

SET_ASIDE = Health(START, "aside/diagnoser", Level.STALE, "unconfigured: KeyError: 'x'", ())
STATES = {
    "fine": shown(NOMINAL),
    "jammed": shown(NOMINAL, LAST),
    "splitting": shown(FIRST),
    "unseen": shown(replace(NOMINAL, outcome=Outcome.NOT_OBSERVABLE)),
    "stopped": shown(replace(NOMINAL, stale=True)),
    "fresh": OperatorState(),
    "aside": shown(SET_ASIDE),
    "also_fine": shown(NOMINAL),
}


def test_the_worst_stand_comes_first() -> None:
    rows = stand_rows(STATES, START)
    # A fault named, no data, an alarm not acknowledged before none, no verdict yet, all well.
    assert [row.name for row in rows] == [
        "jammed", "stopped", "splitting", "unseen", "aside", "fresh", "also_fine", "fine",
    ]  # fmt: skip
    assert [row.level for row in rows[:3]] == [Level.ERROR, Level.STALE, Level.WARN]
    assert [row.ringing for row in rows] == [1, 0, 1, 0, 0, 0, 0, 0]


def test_each_line_says_the_verdict_or_why_there_is_none() -> None:
    panel = hall(STATES, START)
    lines = {line.key: line.text for line in panel.lines}
    assert panel.title == (
        "STANDS  8: 1 with a fault, 1 silent, 2 to look at, 2 without a verdict, "
        "2 without deviation"
    )
    assert lines["jammed"].startswith("jammed     [1 to acknowledge] ")
    assert lines["jammed"].endswith("ERROR ISOLATED (1 possible: jam): words")
    assert lines["aside"] == ("aside      no verdict yet (diagnoser unconfigured: KeyError: 'x')")
    assert hall({}, START).title == "STANDS  none found"


def test_a_diagnosis_that_is_gone_is_silent() -> None:
    (row,) = stand_rows({"gone": shown(LAST)}, LAST.stamp_ns + 60 * 10**9)
    assert row.level is Level.STALE
    assert "the diagnosis has stopped publishing" in row.text
