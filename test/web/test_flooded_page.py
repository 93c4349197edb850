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

"""500 alarms in a minute, names of 200 letters, no procedure: readable, bounded, said."""

from __future__ import annotations

import time
from collections.abc import Iterator
from dataclasses import replace

import pytest
from support import browser as browsers
from support.verdicts import LAST

pytest.importorskip("axe_core_python", reason="pip install axe-core-python")
pytest.importorskip("nicegui", reason="the page needs NiceGUI: pip install nicegui")

from support.screens.axe import SIZES, findings
from support.screens.page_session import PageSession, page_session

COUNT = 500
NAME = "n" * 200
OVER = """[...document.querySelectorAll('#panel-answer *')].filter(
  (e) => getComputedStyle(e).display !== 'inline'
    && (e.getBoundingClientRect().right > innerWidth || e.scrollWidth > e.clientWidth + 1)
).map((e) => e.outerHTML.slice(0, 80))"""
"""Elements of the verdict that run out of the window or of their own box."""


@pytest.fixture(scope="module")
def flooded(tmp_path_factory: pytest.TempPathFactory) -> Iterator[PageSession]:
    if browsers.missing():
        pytest.skip(browsers.missing())
    with page_session(tmp_path_factory.mktemp("flood")) as opened:
        opened.tell_channels()
        member = replace(LAST.members[0], fault=NAME)
        # Of this shift, for verdicts go on to come with the time of day.
        begun_ns = time.time_ns() - 120 * 10**9
        for k in range(COUNT):
            at_ns = begun_ns + k * 60 * 10**9 // COUNT
            opened.take(
                replace(
                    LAST, detected_stamp_ns=at_ns, stamp_ns=at_ns, members=(member,),
                    words=f"the fault is {NAME}",
                )
            )  # fmt: skip
        opened.start()
        opened.browser.open(opened.url)
        opened.browser.until_text(".chips", "LIVE")
        yield opened


def test_all_are_counted_and_a_hundred_are_listed(flooded: PageSession) -> None:
    browser = flooded.browser
    browser.until_text(".chips", f"{COUNT} not acknowledged")
    browser.until_text("#panel-episodes", "400 more of them in the journal")
    browser.until_text(
        "#panel-episodes", f"at most {COUNT} alarms within 10 min: a flood, above 10"
    )
    assert browser.run("document.querySelectorAll('#panel-episodes [data-is]').length") == 100
    assert "first out" in browser.text("#panel-episodes tr:last-child")
    assert browser.run("document.body.innerHTML.length") < 1_000_000


def test_a_fault_without_a_procedure_says_whom_to_ask(flooded: PageSession) -> None:
    flooded.browser.until_text("#panel-answer", "No procedure is stated for this fault: ask")


@pytest.mark.in_turn(2)
def test_names_break_within_their_panel_at_every_size(flooded: PageSession) -> None:
    """Nothing runs out of its box, is cut off, or makes the bar grow."""
    browser = flooded.browser
    for width, height in SIZES:
        browser.size(width, height)
        browser.until(f"innerWidth === {width}")
        assert browser.run("document.documentElement.scrollWidth") <= width
        assert browser.run("document.querySelector('.bar-top').offsetHeight") <= 80
        assert browser.run(OVER) == []
    live = "document.querySelector('.chips')?.innerText.includes('LIVE')"
    assert findings(browser, live) == []


def test_a_screen_of_them_is_acknowledged_and_the_next_comes_up(flooded: PageSession) -> None:
    browser = flooded.browser
    browser.size(1440, 1000)
    browser.open(flooded.url)
    browser.until_text(".filter", "Acknowledge all shown")
    browser.run("(document.querySelector('.filter button').click(), true)")
    browser.until_text(".filter", "Acknowledge these 100?")
    browser.run("(document.querySelector('.filter button').click(), true)")
    browser.until_text(".chips", f"{COUNT - 100} not acknowledged")
    browser.until_text("#panel-episodes", "300 more of them in the journal")
