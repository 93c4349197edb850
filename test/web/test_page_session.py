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

"""What people do on the page in a real Chromium, from the first key to the last."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import pytest
from support import browser as browsers
from support.verdicts import FLAG, LAST, NOMINAL, START

from flea_diag.wire.records import Health, Level

pytest.importorskip("axe_core_python", reason="pip install axe-core-python")
pytest.importorskip("nicegui", reason="the page needs NiceGUI: pip install nicegui")

from support.screens.axe import SIZES, findings
from support.screens.page_session import PageSession, page_session

ENTER, ESCAPE = "\ue007", "\ue00c"
POINT = """(() => {
  const over = document.querySelector('#panel-residual .u-over'), b = over.getBoundingClientRect();
  const at = {clientX: b.left + 0.9 * b.width, clientY: b.top + 9, bubbles: true};
  for (const name of ['mouseenter', 'mousemove']) over.dispatchEvent(new MouseEvent(name, at));
  return true; })()"""
"""Points at a moment near the end of the first chart."""
OPEN = "document.querySelector('dialog[open]')"


@pytest.fixture(scope="module")
def session(tmp_path_factory: pytest.TempPathFactory) -> Iterator[PageSession]:
    if browsers.missing():
        pytest.skip(browsers.missing())
    with page_session(tmp_path_factory.mktemp("page")) as opened:
        opened.browser.open(opened.url)
        yields_its_first_minute(opened)
        opened.tell_channels(lost=1033)
        opened.take(NOMINAL)
        opened.start()
        opened.browser.until_text(".chips", "LIVE")
        yield opened


def yields_its_first_minute(session: PageSession) -> None:
    """While nodes compile the page says how far they are; before that, what is missing."""
    session.browser.until_text("#panel-answer", "Start the diagnoser")
    session.take(Health(1, "/observer", Level.WARN, "compiling, 12 of 31, about 20 s"))
    session.browser.until_text("#panel-answer", "The observer is compiling, 12 of 31, about 20 s.")


def test_a_healthy_stand_says_what_is_and_no_more(session: PageSession) -> None:
    browser = session.browser
    browser.until_text("#panel-tree", "features are requested only while")
    browser.until_text("#panel-vibration", "accelerometer_1_x")
    browser.until_text("#panel-residual", "0 σ")
    browser.until_text("#panel-residual", "0 readings held")
    assert "e-16" not in browser.text("#panel-residual")
    browser.until_text("#panel-quality", "1033 lost")
    lost = "[...document.querySelectorAll('#panel-streams tr')].find(r => r.innerText.includes("
    browser.until(f"{lost}'sensors/slow')).lastChild.innerText === '1033'")


def test_what_is_typed_goes_into_the_dialog_from_the_next_key_on(session: PageSession) -> None:
    """In one burst, faster than any answer of the server; the text holds keys of the page."""
    browser = session.browser
    session.take(FLAG, LAST)
    browser.until_text("#panel-episodes", "not acknowledged")
    browser.press("c", "at rest, clamp moved", ENTER)
    browser.until_text("#panel-episodes", "Ada: at rest, clamp moved")
    assert all(alarm.standing for alarm in session.desk.state.alarms)
    # What stands in a field beforehand is replaced by what is typed, and Escape saves nothing.
    browser.press("m", "load changed", ENTER)
    browser.until_text("#panel-episodes", "load changed")
    assert [mark.text for mark in session.desk.state.marks] == ["load changed"]
    browser.press("m", "nothing", ESCAPE)
    browser.until(f"!{OPEN}")
    browser.press("c", ENTER)
    browser.until_text("dialog[open]", "Enter a text first")
    browser.press(ESCAPE, "?")
    browser.until_text("dialog[open]", "Keys")
    browser.press("a", ESCAPE)
    browser.until(f"!{OPEN}")
    browser.press("a")
    browser.until_text("#panel-episodes", "by Ada")
    assert [mark.text for mark in session.desk.state.marks] == ["load changed"]


def test_a_key_counts_from_the_moment_a_dialog_is_closed(session: PageSession) -> None:
    """The browser takes the focus out of a field that is gone only with a later frame."""
    browser = session.browser
    keys = browser.run(f"""(() => {{
      document.querySelector('[data-opens=mark]').click();
      {OPEN}.close();
      const typed = new KeyboardEvent('keydown', {{key: '?', bubbles: true}});
      document.activeElement.dispatchEvent(typed);
      return {OPEN}?.dataset.name; }})()""")
    assert keys == "keys"
    browser.press(ESCAPE)
    browser.until(f"!{OPEN}")


def test_the_charts_are_held_zoomed_and_kept(session: PageSession) -> None:
    browser = session.browser
    frames = "document.querySelector('#panel-residual .strips').frames"
    values = "[...document.querySelectorAll('#panel-residual output')].map(o => o.innerText).join()"
    pause = "document.querySelector('[data-strip=pause]')"
    browser.run("document.getElementById('panel-residual').scrollIntoView()")
    browser.until(f"{frames} > 2")
    browser.run(f"{pause}.click()")
    held = browser.run(frames)
    # The cursor over one chart shows its moment in all of them, also while they are held.
    assert browser.run(POINT)
    browser.until(f"({values}.match(/[0-9]+:[0-9]+:[0-9]+[.][0-9]/g) || []).length >= 4")
    assert browser.run(frames) == held
    browser.run("(URL.createObjectURL = (blob) => { window.saved = blob; return '#'; }, true)")
    browser.run("(document.querySelector('[data-strip=csv]').click(), true)")
    browser.run("(window.saved.text().then((text) => { window.csv = text; }), true)")
    browser.until("window.csv?.startsWith('time (UTC),parity_mechanical low (σ)')")
    browser.run("(document.querySelector('[data-strip=png]').click(), true)")
    browser.until("window.saved.type === 'image/png' && window.saved.size > 5000")
    session.z = (9.0, 9.0, 51.0, 0.9)
    browser.run("(document.querySelector('[data-span=\"600\"]').click(), true)")
    browser.until(f"{pause}.getAttribute('aria-pressed') === 'false'")
    browser.run(f"({POINT.replace('mousemove', 'mouseleave')}, true)")
    browser.until_text("#panel-residual", "▲ 51 readings held")
    session.z = (0.0, 4.7e-16, 0.0, 0.05)


def test_an_alarm_is_undone_shelved_and_taken_out_of_service(session: PageSession) -> None:
    browser, ringing = session.browser, "document.body.classList.contains('ringing')"
    session.take(replace(LAST, detected_stamp_ns=START + 7))
    browser.until(ringing)
    browser.press("a")
    browser.until(f"!{ringing}")
    browser.run("(document.querySelector('[data-act=undo]').click(), true)")
    browser.until(ringing)
    browser.run("(document.querySelector('[data-opens=shelve]').click(), true)")
    browser.press("part ordered", ENTER)
    browser.until(f"!{ringing}")
    browser.until_text("#panel-episodes", "shelved: does not ring")
    browser.until_text("#panel-episodes", "part ordered")
    browser.run("(document.querySelector('[data-act=unshelve]').click(), true)")
    browser.until(ringing)
    browser.press("o", "maintenance", ENTER)
    browser.until_text(".chips", "ALARMS OUT OF SERVICE")
    browser.until(f"!{ringing}")
    session.desk.set_service(False, "done")
    browser.until(ringing)
    browser.press("a")
    browser.until(f"!{ringing}")


def test_the_report_of_the_shift_is_one_address(session: PageSession) -> None:
    browser = session.browser
    browser.open(f"{session.url}report")
    assert browser.title() == "Shift report: flea_diag · bay"
    assert "ISOLATED" in browser.text("table")
    browser.open(session.url)
    browser.until_text(".chips", "LIVE")


def test_the_list_shows_what_is_asked_for_and_acknowledges_what_is_shown(
    session: PageSession,
) -> None:
    browser = session.browser
    shown = (
        "[...document.querySelectorAll('#panel-episodes [data-is]')].filter(e => e.offsetParent)"
    )
    for k in (11, 12, 13):
        session.take(replace(LAST, detected_stamp_ns=START + k))
    everything = len(session.desk.state.alarms)
    browser.until(f"{shown}.length === {everything}")
    choose = "document.querySelector('.filter select')"
    browser.press("f")
    browser.until(f"document.activeElement === {choose}")
    browser.run(f"({choose}.value = 'standing', {choose}.dispatchEvent(new Event('change')), true)")
    browser.until(f"{shown}.length === 3")
    browser.until_text(".filter", f"3 of {everything} shown")
    # What is drawn anew is filtered, too: a fourth alarm appears, one that is acknowledged goes.
    session.take(replace(LAST, detected_stamp_ns=START + 14))
    browser.until(f"{shown}.length === 4")
    session.desk.acknowledge(session.desk.state.alarms[-1].key)
    browser.until(f"{shown}.length === 3")
    # All that is shown, and nothing else, is acknowledged by two clicks. A list that is drawn anew
    # between them asks again, so that both come at once.
    assert browser.run(f"""(() => {{
      const all = document.querySelector('.filter button');
      all.click();
      const asked = [all.textContent, {shown}.length];
      all.click();
      return asked; }})()""") == ["Acknowledge these 3?", 3]
    browser.until(f"{shown}.length === 0")
    browser.run(f"({choose}.value = 'every', {choose}.dispatchEvent(new Event('change')), true)")
    text = "document.querySelector('.filter input')"
    browser.run(f"({text}.value = 'part ORDERED', {text}.dispatchEvent(new Event('input')), true)")
    browser.until(f"{shown}.length === 1")
    browser.run(f"({text}.value = '', {text}.dispatchEvent(new Event('input')), true)")
    browser.until(f"{shown}.length === {everything} + 1")


def test_a_browser_an_hour_behind_says_so(session: PageSession) -> None:
    """Its own clock stands nowhere on the page but beside the stand's, which it then names."""
    browser = session.browser
    note = "document.querySelector('.other-clock')"
    browser.until(f"{note}.hidden")
    browser.run("(Date.now = ((now) => () => now() - 3600e3)(Date.now), true)")
    browser.until(f"!{note}.hidden")
    browser.until_text(".other-clock", "The clock of this browser is 60 min behind")
    browser.until_text(".chips", "LIVE")
    browser.open(session.url)
    browser.until_text(".chips", "LIVE")
    browser.until(f"{note}.hidden")


def test_light_and_dark_are_turned_and_remembered(session: PageSession) -> None:
    browser, dark = session.browser, "document.body.classList.contains('body--dark')"
    browser.theme("light")
    browser.until(f"!{dark}")
    browser.press("d")
    browser.until(dark)
    browser.open(session.url)
    browser.until_text(".chips", "LIVE")
    browser.until(dark)
    browser.press("d")
    browser.until(f"!{dark}")


def test_the_bar_stands_still_and_is_small_at_every_size(session: PageSession) -> None:
    browser, bar = session.browser, "document.querySelector('.bar-top').offsetHeight"
    for width, height in SIZES:
        browser.size(width, height)
        browser.until(f"innerWidth === {width}")
        session.take(replace(NOMINAL, detected_stamp_ns=-1))
        browser.until("!document.body.classList.contains('ringing')")
        before = browser.run(bar)
        session.take(replace(LAST, detected_stamp_ns=START + width))
        browser.until("document.body.classList.contains('ringing')")
        assert browser.run(bar) == before <= 80
        assert browser.run("document.documentElement.scrollWidth") <= width
        browser.press("a")
        browser.until("!document.body.classList.contains('ringing')")
    browser.size(1440, 1000)


@pytest.mark.in_turn(2)
def test_whoever_cannot_see_it_reads_it_all_the_same(session: PageSession) -> None:
    """No finding of axe, in both themes, at every size, with an alarm."""
    browser = session.browser
    session.take(replace(LAST, detected_stamp_ns=START + 5))
    browser.until_text("[role=status]", "ISOLATED (1 possible: jam): words")
    live = "document.querySelector('.chips')?.innerText.includes('LIVE')"
    assert findings(browser, live) == []
    assert browser.run("document.documentElement.lang") == "en-US"
    browser.press("a")
    browser.until("!document.body.classList.contains('ringing')")
    browser.open(f"{session.url}report?hours=12")
    assert findings(browser, "document.querySelector('h1')") == []
    browser.size(1440, 1000)
    browser.open(session.url)
    browser.until_text(".chips", "LIVE")


def test_what_is_over_says_so_with_its_end_and_duration(session: PageSession) -> None:
    browser = session.browser
    over = replace(LAST, detected_stamp_ns=START + 10**13, stamp_ns=START + 10**13)
    session.take(over, replace(NOMINAL, stamp_ns=over.stamp_ns + 12 * 10**9))
    browser.until_text("#panel-episodes", "returned 01:00:12.0 after 12.0 s")
    first = "document.querySelector('#panel-episodes tr:nth-child(2)')"
    assert not browser.run(f"{first}.querySelector('.state.error')")


def test_a_dead_stand_leaves_nothing_good_behind(session: PageSession) -> None:
    browser = session.browser
    session.lives.clear()
    browser.until_text(".chips", "NO VERDICT for")
    assert "isolator" not in browser.text(".chips") + browser.text("#panel-answer")
    browser.until("!document.querySelector('#panel-quality .state.ok')")
    browser.until_text("#panel-quality", "no scan for")
    session.lives.set()
    browser.until_text(".chips", "LIVE")
    browser.until("!!document.querySelector('#panel-quality .state.ok')")
