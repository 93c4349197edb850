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

"""The page in a real Chromium, beside a live stand whose screw jams at 8 s."""

from __future__ import annotations

import os
import signal
import socket
import urllib.request
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path

import pytest
from support import browser as browsers
from support.browser import Browser, chromium
from support.live import Peer, Process, node
from support.verdicts import LAST, START

pytest.importorskip("nicegui", reason="the page needs NiceGUI: pip install nicegui")

from flea_diag.errors import ConfigurationError
from flea_diag.nodes.operator.web import WebParameters, start
from flea_diag.web.server import Server
from flea_diag.wire.records import AmbiguityGroup, Detection, Outcome, Truth

NODE = "web"
SAYS_WHERE = "the page is at http://127.0.0.1:"
ON_THE_PAGE_MS = 300.0
"""So soon after the scan that caused it a detection stands on the page, where the machine has a
core for each that wants one."""
PROMPT_S = 1.5
"""So soon a page that is opened after the diagnosis shows the verdict."""


@pytest.fixture
def browser() -> Iterator[Browser]:
    if browsers.missing():
        pytest.skip(browsers.missing())
    with chromium() as opened:
        yield opened


@pytest.fixture
def serve(domain: int, tmp_path: Path) -> Callable[..., Process]:
    """Starts the page's node; all share one journal."""
    journal = f"journal:={tmp_path / 'alarms.sqlite'}"

    def served(port: int = 0) -> Process:
        given = (f"port:={port}", journal, "author:=Ada")
        return Process(node(NODE, *(text for pair in given for text in ("-p", pair))), domain)

    return served


def port_of(web: Process) -> int:
    """Where the page is served."""
    told = web.wait_for(SAYS_WHERE).partition(SAYS_WHERE)[2]
    return int(told.partition("/")[0])


def test_a_jam_from_the_first_scan_to_the_last_comment(
    domain: int, serve: Callable[..., Process], browser: Browser
) -> None:
    daq = node(
        "daq", "-p", "fault:=jam", "-p", "fault_onset_s:=8.0",
        "-p", "duration_s:=90.0", "-p", "wait_for_subscribers:=2",
    )  # fmt: skip
    diagnoser = node("diagnoser")
    with Peer(domain) as peer, Process(diagnoser, domain) as stage, serve() as web:
        port = port_of(web)
        browser.open(f"http://127.0.0.1:{port}/")
        browser.until_text("#panel-answer", "NO VERDICT YET")
        peer.listen(Detection, AmbiguityGroup)
        peer.bus.subscribe(Truth, peer.records.append)
        assert not browser.run(SHOWS_INJECT), "no stand is here that takes faults"
        with Process(daq, domain):
            browser.until_text("#panel-answer", "NOMINAL")
            browser.until_text(".chips", "LIVE")
            assert "No episode" in browser.text("#panel-group")
            the_detection_is_on_the_page_at_once(peer, browser)
            the_pictures_show_it(peer, browser)
            it_fits_a_tablet(browser)
            assert browser.foreign(f"127.0.0.1:{port}") == []
            people_say_something(browser)
            a_fault_is_put_into_the_simulated_stand(peer, browser)
            stage.signal(signal.SIGKILL)
            browser.until_text(".chips", "NO VERDICT for")
            with Process(diagnoser, domain):
                browser.until_text(".chips", "LIVE")
                the_page_survives_its_server(serve, web, port, browser)


def the_detection_is_on_the_page_at_once(peer: Peer, browser: Browser) -> None:
    flag = peer.find(lambda r: isinstance(r, Detection) and r.detected)
    browser.until("'DETECTED' in seen")
    crowd = max(os.getloadavg()[0] / len(os.sched_getaffinity(0)), 1.0)
    late_ms = browser.run("seen.DETECTED") - flag.stamp_ns / 1e6
    assert 0.0 < late_ms < ON_THE_PAGE_MS * crowd


def the_pictures_show_it(peer: Peer, browser: Browser) -> None:
    last = peer.find(lambda r: isinstance(r, AmbiguityGroup) and r.outcome is Outcome.ISOLATED)
    browser.until_text("#panel-answer", last.words)
    browser.until_text("#panel-group", "jam left")
    browser.until_text("#panel-symbols", "parity_mechanical")
    browser.until_text("#panel-tree", last.features_computed[0])
    assert browser.run("document.querySelectorAll('#panel-causes .node.lit').length") >= 3
    charts = browser.run("[...document.querySelectorAll('.strip b')].map(e => e.textContent)")
    assert {"motor_current", "parity_mechanical", "accelerometer_2_z"} <= set(charts)
    browser.until(f"{INKED} > 200")
    browser.run("document.getElementById('panel-channel').scrollIntoView()")
    browser.until("document.querySelector('#panel-channel .strips').frames > 10")


def it_fits_a_tablet(browser: Browser) -> None:
    """Nothing is cut off to the right, and a finger hits every button of the bar."""
    browser.size(820, 1180)
    browser.until("innerWidth === 820")
    assert browser.run("document.documentElement.scrollWidth <= innerWidth")
    heights = "[...document.querySelectorAll('.bar-top button')].filter(b => b.offsetParent)"
    assert min(browser.run(f"{heights}.map(b => b.offsetHeight)")) >= 40
    browser.size(1440, 1000)


INKED = """(() => {
  const c = document.querySelector('#panel-residual canvas');
  const d = c.getContext('2d').getImageData(0, 0, c.width, c.height).data;
  let n = 0; for (let k = 3; k < d.length; k += 4) n += d[k] > 0; return n; })()"""
"""Pixels of the first residual's chart that are drawn on."""


SHOWS_INJECT = "!!document.querySelector('[data-key=i]:not(.hidden)')"
RUNG = "window.fleaBell.rung"
TALLY = """(() => {
  const context = window.fleaBell.context, resume = context.resume.bind(context);
  window.fleaTally = {woken: 0, since: performance.now()};
  context.resume = () => { window.fleaTally.woken += 1; return resume(); }; })()"""
"""Counts from now on how often the bell is woken."""


def people_say_something(browser: Browser) -> None:
    """With the keyboard alone; what they write is text, whatever it looks like.

    The alarm rings from the first touch on, in the title as well, until it is acknowledged.
    """
    assert browser.title().startswith("▲ 1 not acknowledged · flea_diag")
    browser.until_text(".chips", "bell muted until the first click or key on this page")
    # A wish to sound that comes before the first touch stays in memory for ever.
    browser.run(TALLY)
    browser.until("performance.now() - window.fleaTally.since > 600")
    assert browser.run("window.fleaTally.woken") == 0
    browser.press("c", "<b>nut is hot</b>", "\ue007")
    browser.until_text("#panel-episodes", "Ada: <b>nut is hot</b>")
    browser.until(f"{RUNG} > 1")
    assert "mute" not in browser.text(".chips")
    browser.press("m", "load changed", "\ue007")
    browser.until_text("#panel-episodes", "load changed")
    browser.press("a")
    browser.until_text("#panel-episodes", "acknowledged")
    browser.until("!document.querySelector('.chips').innerText.includes('not acknowledged')")
    browser.until("document.title.startsWith('flea_diag')")
    assert not browser.run("document.body.classList.contains('ringing')")


def a_fault_is_put_into_the_simulated_stand(peer: Peer, browser: Browser) -> None:
    """What the stand refuses is told in its own words; what it takes, its truth says."""
    browser.until(SHOWS_INJECT)
    for asked, answer in (
        ("gremlin", "Not injected"),
        ("spall:0.8", "The stand accepted spall:0.8"),
    ):
        browser.press("i", asked, "\ue007")
        browser.until_text(".q-notifications", answer)
    peer.find(lambda r: isinstance(r, Truth) and r.fault == "spall")


def the_page_survives_its_server(
    serve: Callable[..., Process], web: Process, port: int, browser: Browser
) -> None:
    """What is entered meanwhile is saved by whichever server is there next."""
    lost, enter = "document.body.classList.contains('lost')", "\ue007"
    for end, text in ((signal.SIGSTOP, "while it hung"), (signal.SIGKILL, "while it was away")):
        web.child.send_signal(end)
        browser.until(lost)
        browser.until_text(".lost-banner", "DISCONNECTED since")
        browser.press("c", text, enter)
        browser.until_text("dialog[open]", "it is saved as soon as the page is back")
        if end is signal.SIGSTOP:
            web.child.send_signal(signal.SIGCONT)
            browser.until_text("#panel-episodes", text)
    web.end()
    with serve(port) as again:
        again.wait_for(SAYS_WHERE)
        browser.until(f"!{lost}")
        browser.until_text("#panel-episodes", "while it was away")
        browser.until_text("#panel-episodes", "nut is hot")
        browser.until_text(".chips", "LIVE")
        browser.open(f"http://127.0.0.1:{port}/")
        browser.until_text(".chips", "LIVE", PROMPT_S)
        assert again.signal(signal.SIGINT) == 0


# --- what rings ------------------------------------------------------------------------------


def test_a_replay_never_rings_and_an_alarm_rings_again_after_a_restart(
    domain: int, serve: Callable[..., Process], browser: Browser
) -> None:
    rings = "document.title.startsWith('▲ 1 not acknowledged')"
    with Peer(domain) as peer, serve() as web:
        port = port_of(web)
        browser.open(f"http://127.0.0.1:{port}/")
        peer.bus.publish(replace(LAST, source="replay"))
        browser.until_text("#panel-episodes", "from a replay: does not ring")
        assert not browser.run(rings)
        assert not browser.run("document.body.classList.contains('ringing')")
        peer.bus.publish(replace(LAST, detected_stamp_ns=START + 1))
        browser.until(rings)
        browser.press("?")  # somebody has touched the page: it may sound
        browser.until(f"{RUNG} > 0")
        assert web.signal(signal.SIGINT) == 0
        with serve(port) as again:
            again.wait_for(SAYS_WHERE)
            browser.until("!document.body.classList.contains('lost')")
            browser.open(f"http://127.0.0.1:{port}/")
            browser.until(rings)
            browser.press("a")
            browser.until(f"!{rings}")
            browser.until_text("#panel-episodes", "acknowledged")


# --- what it refuses ------------------------------------------------------------------------


def test_the_node_says_why_it_does_not_start(domain: int, serve: Callable[..., Process]) -> None:
    with serve() as first:
        port = port_of(first)
        answer = urllib.request.urlopen(f"http://127.0.0.1:{port}/")
        assert "default-src 'self'" in answer.headers["content-security-policy"]
        with serve(port) as second:
            assert second.end() == 2
    assert f"port = {port}: cannot be used" in second.output
    assert "Traceback" not in second.output


def test_who_asks_before_the_server_is_at_it_waits_for_the_answer() -> None:
    server = Server("flea_diag", "127.0.0.1", 0, token="")
    with socket.create_connection(("127.0.0.1", server.port), timeout=60.0) as early:
        early.sendall(f"GET / HTTP/1.1\r\nHost: 127.0.0.1:{server.port}\r\n\r\n".encode())
        server.start()
        assert early.recv(64).startswith(b"HTTP/1.1 ")
    server.close()


def test_the_network_needs_a_token_file() -> None:
    with pytest.raises(ConfigurationError, match="opens the page to the network"):
        start(None, WebParameters(address="0.0.0.0"))  # type: ignore[arg-type]
