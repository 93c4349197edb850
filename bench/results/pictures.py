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

"""Creates the screenshots in docs: a live run with a jam, on each screen.

    .venv/bin/python bench/results/pictures.py            all screenshots, into docs
    .venv/bin/python bench/results/pictures.py stands     that of several stands alone

Needs Chromium, like the tests of the page. Review the screenshots before committing them.
"""

from __future__ import annotations

import asyncio
import sys
import tempfile
import threading
from contextlib import ExitStack
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "test"))

from support.browser import Browser, chromium, missing
from support.live import Peer, Process, node

from flea_diag.nodes.operator.alarm_journal import AlarmJournal
from flea_diag.nodes.operator.desk import Desk, connect
from flea_diag.nodes.run.domain import reserved_domain
from flea_diag.wire.records import Outcome

DOCS = ROOT / "docs"
SAYS_WHERE = "the page is at "
PAST_S = 14.0
"""Time shown after the verdict."""
LIMIT_S = 120.0


def console_picture(desk: Desk, peer: Peer, browser: Browser, target: Path) -> None:
    """Screenshot of the console, at a size that fits most panels."""
    from flea_diag.nodes.operator.console_app import ConsoleApp

    drawn: list[str] = []

    async def draw() -> None:
        app = ConsoleApp(desk)
        async with app.run_test(size=(152, 51)) as pilot:
            await pilot.pause(0.5)
            app.screen_stack[0].redraw()  # type: ignore[attr-defined]
            await pilot.pause(0.3)
            drawn.append(app.export_screenshot())

    painter = threading.Thread(target=lambda: asyncio.run(draw()))
    painter.start()
    peer.until(lambda: not painter.is_alive(), LIMIT_S)
    with tempfile.TemporaryDirectory() as folder:
        page = Path(folder) / "console.html"
        page.write_text(f"<style>* {{ margin: 0 }}</style>{drawn[0]}", encoding="utf-8")
        browser.size(1300, 900)
        browser.open(page.as_uri())
        keep(browser, target)


def keep(browser: Browser, target: Path) -> None:
    """Save the window with as many colours as it needs."""
    from PIL import Image

    browser.shot(target)
    Image.open(target).convert("RGB").quantize(256).save(target, optimize=True)
    print(target)


def page_pictures(browser: Browser, port: str, web: Process, peer: Peer, desk: Desk) -> None:
    """Screenshots of the page on desktop and tablet, and without its server."""
    url = f"http://127.0.0.1:{port}/"
    browser.size(1440, 1000)
    browser.theme("light")
    browser.open(url)
    browser.until_text(".chips", "LIVE", LIMIT_S)
    browser.until("'ISOLATED' in seen", LIMIT_S)
    browser.press("m", "load changed", "\ue007")
    peer.until(lambda: _isolated(desk), LIMIT_S)
    due_ns = desk.moment_ns() + round(PAST_S * 1e9)
    peer.until(lambda: desk.moment_ns() > due_ns, LIMIT_S)
    browser.until("!document.querySelector('.q-notification')")
    keep(browser, DOCS / "page_diagnosed.png")
    browser.size(820, 1180)
    browser.theme("dark")
    browser.until("document.body.classList.contains('body--dark')")
    browser.run("scrollTo(0, 0)")
    keep(browser, DOCS / "page_tablet.png")
    browser.size(1440, 420)
    browser.theme("light")
    web.child.kill()
    browser.until_text(".lost-banner", "DISCONNECTED")
    keep(browser, DOCS / "page_disconnected.png")


def _isolated(desk: Desk) -> bool:
    return desk.state.group is not None and desk.state.group.outcome is Outcome.ISOLATED


def make(domain: int, folder: Path) -> None:
    """Run live and take the screenshots."""
    journal = ("-p", f"journal:={folder / 'page.sqlite'}", "-p", "author:=Ada")
    daq = node(
        "daq", "-p", "fault:=jam", "-p", "fault_onset_s:=12.0",
        "-p", "duration_s:=600.0", "-p", "wait_for_subscribers:=3",
    )  # fmt: skip
    desk = Desk(AlarmJournal(folder / "console.sqlite"), "Ada")
    with (
        Peer(domain) as peer,
        Process(node("diagnoser"), domain),
        Process(node("web", "-p", "port:=0", *journal), domain) as web,
        chromium() as browser,
    ):
        port = web.wait_for(SAYS_WHERE, LIMIT_S).partition(SAYS_WHERE)[2]
        connect(peer.bus, desk)
        with Process(daq, domain):
            peer.until(lambda: _isolated(desk), LIMIT_S)
            console_picture(desk, peer, browser, DOCS / "console.png")
            page_pictures(browser, port.partition("/\n")[0].rpartition(":")[2], web, peer, desk)


def stands_picture(domain: int, folder: Path) -> None:
    """Screenshot of the list of all stands: a fault, a stand without data, one without files."""
    stands = "stands:=['bay_1', 'bay_2', 'bay_3', 'bay_4=./bay_4']"
    names = "stands:=['bay_1', 'bay_2', 'bay_3', 'bay_4']"
    journal = ("-p", f"journal:={folder / 'stands.sqlite'}", "-p", "author:=Ada")
    faults = {"bay_1": "", "bay_2": "jam", "bay_3": ""}
    with ExitStack() as stack:
        enter = stack.enter_context
        fleet = node("fleet", "-p", stands, "-p", "memory:=none")
        enter(Process([*fleet, "-p", "batch_ms:=20"], domain, cwd=folder))
        page = node("web", "-p", "port:=0", "-p", names, *journal)
        web = enter(Process(page, domain))
        browser = enter(chromium())
        browser.size(1440, 620)
        browser.theme("light")
        port = web.wait_for(SAYS_WHERE, LIMIT_S).partition(SAYS_WHERE)[2].partition("/\n")[0]
        browser.open(f"http://127.0.0.1:{port.rpartition(':')[2]}/")
        daqs = {name: enter(Process(daq(name, fault), domain)) for name, fault in faults.items()}
        browser.until_text("#panel-stands", "ISOLATED", LIMIT_S)
        browser.until(f"{WITHOUT_DEVIATION} === 2", LIMIT_S)
        daqs["bay_3"].child.kill()
        browser.until_text("#panel-stands", "no data from the stand", LIMIT_S)
        keep(browser, DOCS / "page_stands.png")


WITHOUT_DEVIATION = "[...document.querySelectorAll('#panel-stands .state.ok')].length"


def daq(name: str, fault: str) -> list[str]:
    """Command of a simulated stand in a namespace of its own."""
    given = ("-p", "duration_s:=600.0", "-p", "wait_for_subscribers:=1")
    fault_given = ("-p", f"fault:={fault}", "-p", "fault_onset_s:=8.0") if fault else ()
    return node("daq", "-r", f"__ns:=/{name}", *given, *fault_given)


def main() -> int:
    """Create the screenshots; return the exit status."""
    if missing():
        print(missing(), file=sys.stderr)
        return 2
    with reserved_domain() as domain, tempfile.TemporaryDirectory() as folder:
        if sys.argv[1:] != ["stands"]:
            make(domain, Path(folder))
        stands_picture(domain, Path(folder))
    return 0


if __name__ == "__main__":
    sys.exit(main())
