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

"""The pages and the report in German: what stands on them in English, too, is no text of ours."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import pytest
from support import browser as browsers
from support.browser import Browser
from support.verdicts import FLAG, LAST, NOMINAL, START

pytest.importorskip("axe_core_python", reason="pip install axe-core-python")
pytest.importorskip("nicegui", reason="the page needs NiceGUI: pip install nicegui")

from support.screens.axe import findings
from support.screens.page_session import PageSession, hall_session, page_session

from flea_diag.wire.records import NextTest, Outcome

SEEN = """(() => {
  const found = new Set(), walk = document.createTreeWalker(document.body, NodeFilter.SHOW_TEXT);
  const theirs = 'script, style, .tcg text, .strip b, kbd';
  while (walk.nextNode())
    if (!walk.currentNode.parentElement.closest(theirs)) found.add(walk.currentNode.data);
  for (const name of ['title', 'placeholder', 'aria-label'])
    for (const e of document.querySelectorAll(`[${name}]`)) found.add(e.getAttribute(name));
  return [...found]; })()"""
SAME = (
    "Filter", "Text", "Pause", "PNG", "CSV", "LIVE", "live", "Symbole", "normal", "CPU %",
    "Status", "Report", "Topic",
)  # fmt: skip
"""Words that are the same in both languages."""
NAMES = re.compile(
    r"[\W\d]*|.*\w_\w.*|.*(sensors/|diagnostics).*|jam|Ada|flea_diag.*|(. )?[A-Z_]+|words|residual|"
    r"jam\+: fits|fits|[+\d.:\- ]+ (s|min|UTC|m/s²|rad/s|σ|N|A|Hz)|load changed|.* Ada: nut is hot",
)
"""Names of channels, faults, outcomes, keys, and what people have said: the same everywhere."""
WIDE = replace(
    LAST,
    outcome=Outcome.INDISTINGUISHABLE,
    detected_stamp_ns=START + 7,
    next_tests=(NextTest("motion", "slow_stroke", 1.5, 20.0, ("jam", "backlash")),),
    to_do=(
        ("run", "stop"), ("urgency", "now"), ("name", "Jammed screw"),
        ("part", "ball screw, in the housing, between screw and nut"),
    ),
)  # fmt: skip


def told(session: PageSession) -> set[str]:
    """Texts of the page and of its report, with alarms and every kind of remark."""
    browser, desk = session.browser, session.desk
    browser.open(session.url)
    session.tell_channels(lost=1033)
    session.take(NOMINAL, FLAG, LAST, WIDE)
    session.start()
    first, last = desk.state.alarms[0].key, desk.state.alarms[-1].key
    desk.comment(first, "nut is hot")
    desk.acknowledge(first)
    desk.shelve(last, 10, "nut is hot")
    desk.mark("load changed", START)
    browser.until("document.querySelectorAll('.strip').length >= 8")
    browser.until("document.querySelectorAll('#panel-episodes [data-is]').length === 2")
    found = set(browser.run(SEEN))
    browser.open(f"{session.url}report")
    return found | set(browser.run(SEEN))


@pytest.fixture(scope="module", autouse=True)
def _needs_a_browser() -> None:
    if browsers.missing():
        pytest.skip(browsers.missing())


@pytest.mark.in_turn(2)
def test_no_word_of_ours_is_left_in_english(tmp_path: Path) -> None:
    both = []
    for code in ("en", "de"):
        (tmp_path / code).mkdir()
        with page_session(tmp_path / code, code) as session:
            both.append({text.strip() for text in told(session)})
            assert session.browser.run("document.documentElement.lang").startswith(code)
    english, german = both
    left = {text for text in english & german if not NAMES.fullmatch(text) and text not in SAME}
    assert left == set()
    assert "Spindel klemmt" in german
    assert any("Einer von jam." in text for text in german), german


@pytest.mark.in_turn(2)
def test_german_is_as_readable_and_fits_as_well(tmp_path: Path) -> None:
    """Longer words break no bar: axe in both themes, at every size, and nothing to the side."""
    with page_session(tmp_path, "de") as session:
        told(session)
        browser = session.browser
        browser.open(session.url)
        live = "document.querySelector('.chips')?.innerText.includes('LIVE')"
        assert findings(browser, live) == []
        fits(browser)


def test_the_list_of_stands_is_german_too(tmp_path: Path) -> None:
    with hall_session(tmp_path, ("bay_1", "bay_2"), "de") as hall:
        hall.stands["bay_1"].take(FLAG, LAST)
        hall.stands["bay_1"].start()
        hall.browser.open(hall.url)
        hall.browser.until_text("#panel-stands", "mit Fehler")
        hall.browser.until_text("#panel-journal", "nicht quittiert")
        fits(hall.browser)


def fits(browser: Browser) -> None:
    """Nothing is cut off to the side, and the bar is small, at every size."""
    for width in (1920, 1300, 820, 390):
        browser.size(width, 900)
        browser.until(f"innerWidth === {width}")
        assert browser.run("document.documentElement.scrollWidth") <= width
        assert browser.run("document.querySelector('.bar-top').offsetHeight") <= 80
        cut = "[...document.querySelectorAll('.bar-top .actions > button')]"
        assert browser.run(f"{cut}.every(b => b.getBoundingClientRect().right <= innerWidth)")
