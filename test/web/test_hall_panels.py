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

"""The list of all stands and the journal of their alarms, as a browser gets them."""

from __future__ import annotations

import re
from dataclasses import replace
from html import unescape

import pytest
from support.verdicts import FIRST, FLAG, LAST, NOMINAL, START, shown

from flea_diag.operator.hall_view import all_alarms, counts, stand_rows
from flea_diag.operator.state import OperatorState
from flea_diag.web.hall_panels import HallView, address, stands
from flea_diag.wire.records import Level

HOSTILE = "<img src=x onerror=alert(1)>\"'&"
STATES = {
    "fine": shown(NOMINAL),
    "hall/jammed": shown(NOMINAL, FLAG, LAST),
    "splitting": shown(replace(FIRST, detected_stamp_ns=START + 1)),
    "stopped": shown(replace(NOMINAL, stale=True)),
    "fresh": OperatorState(),
}


@pytest.fixture
def drawn() -> dict[str, str]:
    view = HallView()
    view.update(STATES, START)
    return view.drawn


def words(html: str) -> str:
    """What a person reads."""
    return " ".join(unescape(re.sub(r"<[^>]+>", " ", html)).split())


def test_the_list_has_the_order_and_the_words_of_the_console(drawn: dict[str, str]) -> None:
    rows = stand_rows(STATES, START)
    assert re.findall(r'data-name="([^"]+)"', drawn["stands"]) == [row.name for row in rows]
    text = words(drawn["stands"])
    assert all(row.text in text for row in rows)
    for level, count, said in counts(rows):
        assert f"{count} {said}" in words(drawn["chips"])
        assert text.count(said) == count, level
    assert "2 not acknowledged" in words(drawn["chips"])


def test_each_stand_leads_to_its_page_by_a_link_and_a_key(drawn: dict[str, str]) -> None:
    first, *_ = re.findall(r"<a [^>]*>", drawn["stands"])
    assert 'href="/stand/hall/jammed"' in first
    assert 'data-key="1"' in first
    assert address('a" onclick="x') == "/stand/a%22%20onclick%3D%22x"


def test_a_verdict_that_is_old_says_how_old() -> None:
    def listed(state: OperatorState, later_s: int = 0) -> str:
        return words(str(stands(stand_rows({"one": state}, LAST.stamp_ns + later_s * 10**9))))

    assert "‖ silent" in listed(shown(LAST), 60)
    assert "evidence of 22:13:24.000 UTC, no verdict for 60 s" in listed(shown(LAST), 60)
    assert "no data from the stand; last verdict" in listed(shown(replace(LAST, stale=True)))
    assert "replay: recorded data" in listed(shown(replace(LAST, source="replay")))
    assert listed(shown(LAST)).endswith("22:13:24.000 ISOLATED (1 possible: jam): words ▲ 1")


def test_the_journal_names_the_stand_of_each_alarm_and_of_its_buttons(
    drawn: dict[str, str],
) -> None:
    assert [name for name, _ in all_alarms(STATES)] == ["splitting", "hall/jammed"]
    text = words(drawn["journal"])
    assert text.index("splitting") < text.index("hall/jammed")
    assert "parity_mechanical_dn: z = 6.5, limit 5" in text
    told = re.findall(r'data-act="ack" data-alarm="([^"]+)"', drawn["journal"])
    assert told == [f"splitting live:{START + 1}", f"hall/jammed live:{START}"]


def test_an_acknowledged_alarm_goes_below_those_that_ring() -> None:
    late = shown(replace(LAST, detected_stamp_ns=START + 5))
    quiet = replace(late.alarms[0], acknowledged_ns=START + 9, acknowledged_by="Ada")
    states = {"early": shown(LAST), "late": replace(late, alarms=(quiet,))}
    assert [name for name, _ in all_alarms(states)] == ["early", "late"]
    view = HallView()
    view.update(states, START)
    assert "acknowledged 22:13:20 UTC by Ada" in words(view.drawn["journal"])
    assert view.drawn["journal"].count('data-act="ack"') == 1


def test_what_has_not_changed_is_not_drawn_again(drawn: dict[str, str]) -> None:
    view = HallView()
    view.update(STATES, START)
    before = dict(view.drawn)
    view.update({name: replace(state) for name, state in STATES.items()}, START)
    assert all(view.drawn[name] is before[name] for name in before)


def test_without_stands_the_page_says_what_to_start() -> None:
    view = HallView()
    view.update({}, START)
    assert "Start its diagnoser, or a fleet." in words(view.drawn["stands"])
    assert "no stand found yet" in words(view.drawn["chips"])


def test_what_comes_from_outside_never_becomes_markup() -> None:
    evil = shown(replace(LAST, words=HOSTILE), replace(FLAG, residual=HOSTILE))
    view = HallView()
    view.update({HOSTILE: evil}, START)
    for name, html in view.drawn.items():
        assert "<img" not in html, name
        assert "onerror" not in re.sub(r"&[a-z#0-9]+;|[^&<>]", "", html), name
    assert HOSTILE in words(view.drawn["stands"])
    assert stand_rows({HOSTILE: evil}, START)[0].level is Level.ERROR
