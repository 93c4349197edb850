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

"""The console as people have it: with Textual's pilot, in a real terminal, and on a live bus."""

from __future__ import annotations

import asyncio
import shlex
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Awaitable, Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from support.live import ROOT, Peer, Process, environment, node
from support.screens.judgements import GONE, HALF, WHOLE
from support.screens.judgements import shown as at_the_end
from support.verdicts import FIRST, FLAG, LAST, NOMINAL, START

from flea_diag.errors import ConfigurationError
from flea_diag.nodes.operator.alarm_journal import AlarmJournal
from flea_diag.nodes.operator.console import chosen_style
from flea_diag.nodes.operator.desk import Desk, connect
from flea_diag.wire.bags.bag import read_bag
from flea_diag.wire.records import (
    OTHER_UNIT,
    ChannelQuality,
    DataQuality,
    Quality,
    Remark,
    RemarkKind,
    Scan,
    Truth,
)

NODE = "console"
PROMPT_S = 1.5
"""So soon a console that starts after the diagnosis shows the verdict."""


def test_the_style_fits_what_there_is() -> None:
    assert chosen_style("auto", terminal=True, textual=True) == "screen"
    assert chosen_style("auto", terminal=True, textual=False) == "page"
    assert chosen_style("auto", terminal=False, textual=True) == "lines"
    assert chosen_style("page", terminal=False, textual=False) == "page"
    with pytest.raises(ConfigurationError, match=r"pip install '(flea_diag|textual)"):
        chosen_style("screen", terminal=True, textual=False)


# -- without a terminal


@pytest.fixture
def desk(tmp_path: Path) -> Desk:
    made = Desk(AlarmJournal(tmp_path / "alarms.sqlite"), "Ada")
    for record in (NOMINAL, FLAG, FIRST):
        made.take(record)
    return made


def piloted(desk: Desk, act: Callable[[Any], Awaitable[None]]) -> None:
    pytest.importorskip("textual", reason="the screen needs Textual: pip install textual")
    from flea_diag.nodes.operator.console_app import ConsoleApp

    async def play() -> None:
        app = ConsoleApp(desk)
        async with app.run_test(size=(140, 50)) as pilot:
            await pilot.pause()
            await act(pilot)

    asyncio.run(play())


def words(pilot: Any) -> str:
    """Everything on the screen, from its own screenshot without the markup."""
    import html
    import re

    pilot.app.screen_stack[0].redraw()
    svg = pilot.app.export_screenshot()
    return html.unescape(re.sub(r"<[^>]+>", "\n", svg)).replace("\xa0", " ")


async def shown(pilot: Any, text: str) -> str:
    """Everything on the screen, once it holds ``text``: a busy machine draws late."""
    deadline_s = time.monotonic() + 30.0
    while text not in words(pilot):
        assert time.monotonic() < deadline_s, f"no {text!r} on the screen:\n{words(pilot)}"
        await pilot.pause(0.05)
    return words(pilot)


def test_the_screen_has_the_verdict_the_group_and_the_alarm(desk: Desk) -> None:
    async def act(pilot: Any) -> None:
        text = await shown(pilot, "POSSIBLE (3)")
        assert "VERDICT  WARN  DETECTED  words" in text
        assert "NEW" in text
        assert "z = 6.5, limit 5" in text

    piloted(desk, act)


def test_a_key_acknowledges_and_another_comments(desk: Desk) -> None:
    async def act(pilot: Any) -> None:
        await pilot.press("a")
        await pilot.press("c", *"greased", "enter")
        await pilot.pause()

    piloted(desk, act)
    (alarm,) = desk.state.alarms
    assert not alarm.rings
    assert [comment.text for comment in alarm.comments] == ["greased"]


def test_escape_says_nothing_and_a_mark_is_kept(desk: Desk, tmp_path: Path) -> None:
    async def act(pilot: Any) -> None:
        await pilot.press("c", "x", "escape", "m", *"load", "enter")
        await pilot.pause()

    piloted(desk, act)
    assert desk.state.alarms[0].comments == ()
    assert [mark.text for mark in AlarmJournal(tmp_path / "alarms.sqlite").marks()] == ["load"]


@pytest.mark.in_turn(2)
@pytest.mark.parametrize("load_cell", [WHOLE, HALF, GONE])
def test_a_key_shows_all_that_was_judged_and_what_was_not_is_said_anyway(
    desk: Desk, load_cell: str
) -> None:
    state, _ = at_the_end(load_cell)
    assert state.quality is not None
    assert state.group is not None
    desk.take(state.quality)
    desk.take(state.group)
    lost = "not judged: parity_mechanical and 4 more"

    async def act(pilot: Any) -> None:
        text = await shown(pilot, "CHANNELS")
        assert (lost in text) == (load_cell != WHOLE)
        assert "winding_short, " not in text
        await pilot.press("j")
        text = await shown(pilot, "faults looked for")
        assert f"of {len(state.quality.judged)} tests in the last 10 s" in text
        assert "motor_temperature_noise" in text
        await pilot.press("j")
        assert "motor_temperature_noise" not in await shown(pilot, "CHANNELS")

    piloted(desk, act)


def test_a_mark_is_of_the_moment_of_its_key_and_not_of_its_last_word(desk: Desk) -> None:
    async def act(pilot: Any) -> None:
        desk.take(Scan(START + 1000, ("motor_current",), (0.0,)))
        await pilot.press("m", *"loa")
        desk.take(Scan(START + 9000, ("motor_current",), (0.0,)))
        await pilot.press(*"d", "enter")
        await shown(pilot, "MARKS  1 kept")

    piloted(desk, act)
    assert [mark.stamp_ns for mark in desk.state.marks] == [START + 1000]


def test_a_unit_in_question_can_be_accepted_and_no_other(desk: Desk) -> None:
    async def act(pilot: Any) -> None:
        await pilot.press("u", "escape")
        assert "Accept unit" not in words(pilot)
        unit = ChannelQuality(OTHER_UNIT, Quality.SATURATED, START, "winding_resistance_ohm +1")
        desk.take(DataQuality(START, (unit,)))
        await shown(pilot, "Accept unit")
        await pilot.press("u", *"rewound", "enter")
        await pilot.pause()

    piloted(desk, act)
    assert [mark.text for mark in desk.state.marks] == ["unit accepted: rewound"]


def test_inject_asks_and_says_what_came_of_it(desk: Desk) -> None:
    entry = desk.faults = Entry()

    async def act(pilot: Any) -> None:
        await shown(pilot, "Inject")
        await pilot.press("i", *"jam:0.5", "enter")
        await shown(pilot, "Not injected: node daq is not running")
        await pilot.press("i", *"clear", "enter")
        await pilot.pause()

    piloted(desk, act)
    assert entry.asked == ["jam:0.5", ""]


def test_a_stand_that_takes_no_faults_is_offered_none(desk: Desk) -> None:
    async def act(pilot: Any) -> None:
        assert "Inject" not in words(pilot)
        await pilot.press("i")
        await pilot.pause()
        assert len(pilot.app.screen_stack) == 1

    piloted(desk, act)


class Entry:
    """A stand that takes faults, and whose node has just gone."""

    present = True

    def __init__(self) -> None:
        self.asked: list[str] = []

    def set(self, value: str, told: Callable[[str], None]) -> None:
        self.asked.append(value)
        told("node daq is not running" if value else "")


def test_the_chosen_fault_shows_its_why(desk: Desk) -> None:
    async def act(pilot: Any) -> None:
        assert "WHY jam" in words(pilot)
        await pilot.press("down")
        assert "WHY ball_nut_friction" in words(pilot)

    piloted(desk, act)


# -- live


def publish(peer: Peer, *records: Any) -> None:
    for record in records:
        peer.bus.publish(record)


def test_a_console_that_starts_late_shows_the_verdict_in_time(domain: int, tmp_path: Path) -> None:
    command = node(NODE, "-p", "style:=lines", "-p", f"journal:={tmp_path / 'a.sqlite'}")
    with Peer(domain) as peer:
        publish(peer, NOMINAL, FLAG, LAST)
        with Process([sys.executable, "-c", "import rclpy"], domain) as warm:
            assert warm.end() == 0  # the disk's cache, not the console, is not what is measured
        began = time.monotonic()
        with Process(command, domain) as console:
            peer.until(lambda: peer.bus.subscribers(type(LAST)) > 0)
            joined = time.monotonic()
            while "ISOLATED" not in console.output and time.monotonic() < began + 15.0:
                peer.bus.wait_until(lambda: False, 0.02)
                console.read()
            shown = time.monotonic()
        assert "ERROR ISOLATED (1 possible: jam): words" in console.output
        assert shown - joined < PROMPT_S


def test_a_fault_is_injected_through_the_parameter_of_the_stand(domain: int) -> None:
    told: list[str] = []
    daq = node("daq", "-p", "duration_s:=60.0")
    with Peer(domain) as peer:
        entry = peer.bus.remote_parameter("daq", "inject")
        entry.set("jam", told.append)
        peer.until(lambda: bool(told))
        assert told == ["node daq is not running"]
        assert not entry.present
        with Process(daq, domain) as stand:
            peer.listen(Truth)
            peer.until(lambda: entry.present)
            entry.set("gremlin", told.append)
            entry.set("jam", told.append)
            peer.find(lambda record: record.fault == "jam")
            peer.until(lambda: len(told) == 3)
            stand.signal(signal.SIGINT)
        peer.until(lambda: not entry.present)
    assert any("gremlin" in why_not for why_not in told[1:])
    assert "" in told[1:]


def test_a_daq_of_another_kind_is_offered_no_faults(domain: int) -> None:
    """A real stand's node may have the name, but not the parameter."""
    with Peer(domain, name="daq") as stand, Peer(domain) as peer:
        entry = peer.bus.remote_parameter("daq", "inject")
        peer.until(lambda: (stand.bus.wait_until(lambda: True, 0.0), entry._asked)[1] is not None)
        answered = entry._asked
        peer.until(lambda: (stand.bus.wait_until(lambda: False, 0.02), answered.done())[1])
        peer.until(lambda: (stand.bus.wait_until(lambda: False, 0.02), entry._asked)[1] != answered)
        assert not entry.present


def test_what_people_say_is_in_the_bag_and_on_the_other_screens(
    domain: int, tmp_path: Path
) -> None:
    recorder = node("recorder", "-p", f"directory:={tmp_path / 'bag'}")
    desks = [Desk(AlarmJournal(tmp_path / f"{name}.sqlite"), name) for name in ("Ada", "Bob")]
    with (
        Peer(domain, name="one") as one,
        Peer(domain, name="two") as two,
        Process(recorder, domain) as process,
    ):
        for peer, desk in zip((one, two), desks, strict=True):
            connect(peer.bus, desk)
        assert one.heard(Remark, count=3)
        publish(one, FIRST)
        both(one, two, lambda: all(desk.state.alarms for desk in desks))
        desks[0].mark("load changed", START + 5)
        desks[0].acknowledge(desks[0].state.alarms[0].key)
        both(one, two, lambda: not desks[1].state.alarms[0].rings)
        assert desks[1].state.alarms[0].acknowledged_by == "Ada"
        assert [mark.text for mark in desks[1].state.marks] == ["load changed"]
        both(one, two, lambda: len(kept(tmp_path / "bag")) == 2)
        assert process.signal(signal.SIGINT) == 0
    mark, acknowledged = kept(tmp_path / "bag")
    assert mark == Remark(START + 5, RemarkKind.MARK, "Ada", "load changed")
    assert acknowledged.kind is RemarkKind.ACKNOWLEDGED


def kept(bag: Path) -> list[Any]:
    """Remarks in a bag that is still written: it is whole each second."""
    return [record for _, record in read_bag(bag, (Remark,))] if any(bag.glob("*.yaml")) else []


def both(one: Peer, two: Peer, predicate: Callable[[], bool]) -> None:
    """Serve two guests until a predicate holds."""
    one.until(lambda: two.bus.wait_until(predicate, 0.02))


# -- in a terminal


class Terminal:
    """A window of tmux with a server of its own."""

    def __init__(self, socket: str) -> None:
        self._tmux = ["tmux", "-f", "/dev/null", "-S", socket]

    def run(self, *arguments: str, **more: Any) -> str:
        done = subprocess.run(
            [*self._tmux, *arguments], capture_output=True, text=True, check=True, **more
        )
        return done.stdout

    def shows(self, text: str) -> bool:
        return text in self.run("capture-pane", "-p", "-t", "0")


@pytest.fixture
def terminal(tmp_path: Path) -> Iterator[Terminal]:
    if shutil.which("tmux") is None:
        pytest.skip("tmux is not installed: apt-get install tmux")
    pytest.importorskip("textual", reason="the screen needs Textual: pip install textual")
    tmux = Terminal(str(tmp_path / "tmux"))
    yield tmux
    subprocess.run([*tmux._tmux, "kill-server"], check=False, capture_output=True)


def test_in_a_terminal_it_shows_takes_keys_and_quits(
    terminal: Terminal, domain: int, tmp_path: Path
) -> None:
    journal = tmp_path / "alarms.sqlite"
    command = node(NODE, "-p", f"journal:={journal}", "-p", "author:=Ada")
    with Peer(domain) as peer:
        publish(peer, NOMINAL, FLAG, LAST)
        shell = f"{shlex.join(command)}; echo ended with $?; exec cat"
        terminal.run(
            "new-session", "-d", "-x", "120", "-y", "40", "sh", "-c", shell,
            env=environment(domain), cwd=ROOT,
        )  # fmt: skip
        peer.until(lambda: terminal.shows("VERDICT  ERROR  ISOLATED  words"))
        peer.until(lambda: terminal.shows("NEW"))
        terminal.run("send-keys", "a")
        peer.until(lambda: terminal.shows("acknowl."))
        publish(peer, replace(LAST, seq=2, words="still words"))
        peer.until(lambda: terminal.shows("still words"))
        terminal.run("send-keys", "q")
        peer.until(lambda: terminal.shows("ended with 0"))
    (alarm,) = AlarmJournal(journal).alarms()
    assert alarm.acknowledged_by == "Ada"


@pytest.mark.in_turn(2)
def test_the_bell_rings_until_somebody_acknowledges_and_never_for_a_replay(
    terminal: Terminal, domain: int, tmp_path: Path
) -> None:
    heard = tmp_path / "heard"
    heard.touch()
    command = node(NODE, "-p", f"journal:={tmp_path / 'alarms.sqlite'}")
    again = f"while :; do {shlex.join(command)}; done"
    with Peer(domain) as peer:
        publish(peer, replace(LAST, source="replay", words="of a replay"))
        terminal.run(
            "new-session", "-d", "-x", "120", "-y", "40", "sh", "-c", again,
            env=environment(domain), cwd=ROOT,
        )  # fmt: skip
        terminal.run("set-hook", "-g", "alert-bell", f"run-shell 'echo >> {heard}'")

        def rings() -> int:
            return len(heard.read_text(encoding="utf-8").splitlines())

        def says(words: str, **more: Any) -> None:
            publish(peer, replace(LAST, words=words, **more))
            peer.until(lambda: terminal.shows(words))

        peer.until(lambda: terminal.shows("of a replay"))
        says("still of a replay", source="replay")
        assert rings() == 0
        says("of the stand", detected_stamp_ns=START + 1)
        peer.until(lambda: rings() >= 2)
        terminal.run("send-keys", "q")  # it starts anew, and has not forgotten
        peer.until(lambda: not terminal.shows("VERDICT"))
        before = rings()
        peer.until(lambda: terminal.shows("of the stand") and rings() > before)
        terminal.run("send-keys", "a")
        peer.until(lambda: terminal.shows("acknowl."))
        says("of the stand once more", detected_stamp_ns=START + 1, seq=8)
        before = rings()  # what rang before the key has been heard by now
        says("of the stand to the end", detected_stamp_ns=START + 1, seq=9)
        assert rings() == before
