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

"""The list of several stands in a real Chromium: filter, report of all, axe."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import pytest
from support import browser as browsers
from support.verdicts import FLAG, LAST, NOMINAL, START

pytest.importorskip("axe_core_python", reason="pip install axe-core-python")
pytest.importorskip("nicegui", reason="the page needs NiceGUI: pip install nicegui")

from support.screens.axe import findings
from support.screens.page_session import HallSession, hall_session

NAMES = ("bay_1", "hall/bay_2", "bay_3")


@pytest.fixture(scope="module")
def hall(tmp_path_factory: pytest.TempPathFactory) -> Iterator[HallSession]:
    if browsers.missing():
        pytest.skip(browsers.missing())
    with hall_session(tmp_path_factory.mktemp("hall"), NAMES) as opened:
        opened.stands["bay_1"].take(NOMINAL)
        opened.stands["hall/bay_2"].take(FLAG, LAST, replace(LAST, detected_stamp_ns=START + 9))
        for stand in opened.stands.values():
            stand.start()
        opened.browser.open(opened.url)
        opened.browser.until_text("#panel-stands", "ISOLATED (1 possible: jam): words")
        yield opened


@pytest.mark.in_turn(2)
def test_the_list_is_for_everybody(hall: HallSession) -> None:
    """No finding of axe, in both themes, at every size."""
    drawn = "document.querySelectorAll('a.stand').length >= 5"
    assert findings(hall.browser, drawn) == []


def test_a_phone_shows_the_verdict_of_each_stand(hall: HallSession) -> None:
    """Without a hand that moves the list to the side."""
    hall.browser.size(390, 844)
    hall.browser.open(hall.url)
    cells = "[...document.querySelectorAll('#panel-stands td:nth-child(5)')]"
    hall.browser.until(f"innerWidth === 390 && {cells}.length === 3")
    assert hall.browser.run(f"{cells}.every(c => c.getBoundingClientRect().right <= 390)")
    assert hall.browser.run("document.querySelector('.bar-top').offsetHeight") <= 80
    hall.browser.size(1440, 1000)


def test_the_report_of_all_stands_names_the_stand_of_each_alarm(hall: HallSession) -> None:
    browser = hall.browser
    hall.stands["bay_3"].take(replace(LAST, detected_stamp_ns=START + 3))
    hall.stands["bay_3"].desk.mark("load changed", START)
    assert browser.run("document.querySelector('a.button[href=\"/report\"]') !== null")
    browser.open(f"{hall.url}report")
    rows = "[...document.querySelectorAll('table')].map(t => t.innerText)"
    stands, alarms, marks = browser.run(rows)
    assert [row.split("\t")[0] for row in stands.splitlines()[1:] if "\t" in row] != []
    assert alarms.count("hall/bay_2") == 2
    assert alarms.count("bay_3") == 1
    assert "load changed" in marks
    assert findings(browser, "document.querySelector('h1')") == []
    browser.open(f"{hall.url}report?stand=hall/bay_2")
    assert browser.title() == "Shift report: hall/bay_2"
    assert "bay_3" not in browser.text("main")
    for asked, said in (
        ("?hours=-1", "greater"),
        ("?hours=x", "number"),
        ("?stand=none", "no such"),
    ):
        browser.open(f"{hall.url}report{asked}")
        assert said in browser.text("body")


def test_the_alarms_of_all_stands_are_filtered_and_acknowledged(hall: HallSession) -> None:
    browser = hall.browser
    browser.open(hall.url)
    shown = "[...document.querySelectorAll('#panel-journal [data-is]')].filter(e => e.offsetParent)"
    browser.until(f"{shown}.length === 3")
    text = "document.querySelector('.filter input')"
    browser.run(f"({text}.value = 'hall/', {text}.dispatchEvent(new Event('input')), true)")
    browser.until(f"{shown}.length === 2")
    click = "(document.querySelector('.filter button').click(), true)"
    browser.run(click)
    browser.until_text(".filter", "Acknowledge these 2?")
    browser.run(click)
    browser.until_text("#panel-journal", "by Ada")
    states = {name: stand.desk.state.alarms for name, stand in hall.stands.items()}
    assert [a.standing for a in states["hall/bay_2"]] == [False, False]
    assert [a.standing for a in states["bay_3"]] == [True]
