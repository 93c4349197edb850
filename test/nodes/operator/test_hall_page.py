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

"""The page of all stands in a real Chromium: list, one opened, alarms, keyboard, tablet."""

from __future__ import annotations

import threading
import urllib.request
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import replace
from pathlib import Path

import pytest
import support.browser as browsers
from support.browser import chromium
from support.live import Peer, Process, node
from support.verdicts import FIRST, FLAG, LAST, NOMINAL, START

pytest.importorskip("nicegui", reason="the page needs NiceGUI: pip install nicegui")

from flea_diag.nodes.operator.alarm_journal import AlarmJournal
from flea_diag.wire.records import Record, Scan

EVERY_S = 0.3
SAYS_WHERE = "the page is at http://127.0.0.1:"
VERDICTS = {
    "bay_1": (NOMINAL,),
    "bay_2": (FLAG, LAST),
    "hall/bay_3": (replace(FIRST, detected_stamp_ns=START + 1),),
}
NAMES = "[...document.querySelectorAll('a.stand[data-name]')].map(a => a.dataset.name).join()"
SELECTED = "document.activeElement.dataset.name"
DOWN, ENTER, ESCAPE = "\ue015", "\ue007", "\ue00c"


@contextmanager
def repeated(peers: dict[str, Peer]) -> Iterator[dict[str, tuple[Record, ...]]]:
    """Each stand gives its verdict again and again; what it says may be changed."""
    told: dict[str, tuple[Record, ...]] = dict(VERDICTS)
    ended = threading.Event()

    def tell() -> None:
        while not ended.wait(EVERY_S):
            for name, records in told.items():
                for record in records:
                    peers[name].bus.publish(record)

    thread = threading.Thread(target=tell)
    thread.start()
    try:
        yield told
    finally:
        ended.set()
        thread.join()


def test_the_stands_on_one_page_worst_first_by_keyboard(domain: int, tmp_path: Path) -> None:
    if browsers.missing():
        pytest.skip(browsers.missing())
    journal = tmp_path / "alarms.sqlite"
    given = ("port:=0", f"journal:={journal}", "author:=Ada", "stands:=['*', 'bay_2=ema']")
    command = node("web", *(t for g in given for t in ("-p", g)))
    with ExitStack() as stack:
        web = stack.enter_context(Process(command, domain))
        peers = {name: stack.enter_context(Peer(domain, name)) for name in VERDICTS}
        told = stack.enter_context(repeated(peers))
        port = web.wait_for(SAYS_WHERE).partition(SAYS_WHERE)[2].partition("/")[0]
        address = f"http://127.0.0.1:{port}"
        browser = stack.enter_context(chromium())
        browser.open(f"{address}/")
        browser.until(f"{NAMES} === 'bay_2,hall/bay_3,bay_1'")
        browser.until_text("#panel-stands", "ISOLATED (1 possible: jam): words")
        browser.until_text("#panel-journal", "parity_mechanical_dn: z = 6.5, limit 5")
        browser.until("document.title.startsWith('▲ 2 not acknowledged')")
        # A tablet shows all of it, and a finger hits every link and button.
        browser.size(820, 1180)
        browser.until("innerWidth === 820")
        assert browser.run("document.documentElement.scrollWidth <= innerWidth")
        hit = "[...document.querySelectorAll('a.stand, .flea button')].filter(e => e.offsetParent)"
        assert min(browser.run(f"{hit}.map(e => e.offsetHeight)")) >= 40
        # What is selected stays so while the list is drawn anew below the keys.
        browser.press(DOWN, DOWN)
        assert browser.run(SELECTED) == "hall/bay_3"
        told["bay_1"] = (replace(NOMINAL, seq=9, words="still fine"),)
        browser.until_text("#panel-stands", "still fine")
        assert browser.run(SELECTED) == "hall/bay_3"
        browser.press(ENTER)
        browser.until_text("#panel-answer", "DETECTED")
        assert browser.run("location.pathname") == "/stand/hall/bay_3"
        browser.until_text(".bar-top", "▲ 1 not acknowledged on other stands")
        peers["hall/bay_3"].until(lambda: peers["hall/bay_3"].bus.subscribers(Scan) == 1)
        browser.press("a")
        browser.until_text("#panel-episodes", "by Ada")
        browser.until("document.title.startsWith('▲ 1 not acknowledged')")
        browser.press(ESCAPE)
        browser.until("location.pathname === '/' && document.title.startsWith('▲ 1 not')")
        browser.press("a")
        browser.until("document.title === 'flea_diag · all stands'")
        assert [a.acknowledged_by for a in AlarmJournal(journal, "bay_2").alarms()] == ["Ada"]
        # A stand that nobody publishes for is none: its address leads to the list.
        with urllib.request.urlopen(f"{address}/stand/nowhere") as answer:
            assert answer.url == f"{address}/"
        browser.open("about:blank")
        peers["hall/bay_3"].until(lambda: peers["hall/bay_3"].bus.subscribers(Scan) == 0)
